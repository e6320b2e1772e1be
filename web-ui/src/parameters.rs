//! Parameters of the control laws as sliders; keys, units, ranges and defaults are the laws' own table.

use api::experiment::Experiment;
use control::law::{LAWS, OWN, ParameterSpec, law_spec};

/// The table of a law; empty for a law that is not known.
pub fn specs(law: &str) -> &'static [ParameterSpec] {
    law_spec(law).map_or(&[], |spec| spec.parameters)
}

/// What a law does, in one line.
pub fn law_title(law: &str) -> &'static str {
    law_spec(law).map_or("", |spec| spec.title)
}

/// Names of all laws that an experiment may have.
pub fn laws() -> impl Iterator<Item = &'static str> {
    LAWS.iter().map(|spec| spec.name).chain([OWN])
}

/// A law's name for people: what its line begins with.
pub fn law_name(law: &str) -> &'static str {
    law_title(law).split_once(": ").map_or(law_title(law), |(name, _)| name)
}

/// The rest of a law's line.
pub fn law_explained(law: &str) -> String {
    let title = law_title(law);
    let rest = title.split_once(": ").map_or(title, |(_, rest)| rest);
    let mut letters = rest.chars();
    letters
        .next()
        .map_or_else(String::new, |c| c.to_uppercase().collect::<String>() + letters.as_str())
}

/// The name beside the slider: the key without its unit, in words.
pub fn title(spec: &ParameterSpec) -> String {
    let units = ["_rad_per_s", "_m_per_s2", "_m_per_s", "_per_s", "_rad", "_m", "_s"];
    let bare = units
        .into_iter()
        .find_map(|unit| spec.key.strip_suffix(unit))
        .unwrap_or(spec.key);
    let bare = bare.replace("epsilon_p", "reference step").replace('_', " ");
    let mut letters = bare.chars();
    letters
        .next()
        .map_or_else(String::new, |c| c.to_uppercase().collect::<String>() + letters.as_str())
}

/// The value in the document, or the default where it says nothing.
pub fn value(experiment: &Experiment, spec: &ParameterSpec) -> f64 {
    experiment
        .control
        .parameters
        .get(spec.key)
        .and_then(serde_json::Value::as_f64)
        .unwrap_or(spec.default)
}

/// Writes a value into the document; the default leaves no trace there.
pub fn set(experiment: &mut Experiment, key: &str, value: f64) {
    let Some(spec) = specs(&experiment.control.law).iter().find(|s| s.key == key) else {
        return;
    };
    let value = value.clamp(spec.min, spec.max);
    if !experiment.control.parameters.is_object() {
        experiment.control.parameters = serde_json::json!({});
    }
    let Some(entries) = experiment.control.parameters.as_object_mut() else {
        return;
    };
    if value == spec.default {
        entries.remove(key);
    } else {
        entries.insert(key.to_owned(), serde_json::json!(value));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::Template;

    #[test]
    fn the_default_leaves_no_trace_and_values_stay_in_range() {
        let mut experiment = Template::RectangleOmni4.experiment();
        set(&mut experiment, "speed_m_per_s", 99.0);
        let spec = specs("waypoints")
            .iter()
            .find(|s| s.key == "speed_m_per_s")
            .expect("the law has a speed");
        assert_eq!(value(&experiment, spec), spec.max);
        set(&mut experiment, "speed_m_per_s", spec.default);
        assert_eq!(experiment.control.parameters, serde_json::json!({}));
        set(&mut experiment, "no_such_thing", 1.0);
        assert_eq!(experiment.control.parameters, serde_json::json!({}));
    }

    #[test]
    fn laws_have_names_for_people() {
        let names: Vec<&str> = laws().map(law_name).collect();
        assert_eq!(names.last(), Some(&"Own controller"));
        assert!(
            names
                .iter()
                .all(|name| !name.is_empty() && name.len() < 32 && !name.contains('_')),
            "{names:?}"
        );
        assert_eq!(law_explained(OWN), "A script, a WebAssembly module or a policy (ONNX)");
    }

    #[test]
    fn every_template_has_a_law_with_named_parameters() {
        for template in Template::ALL {
            let experiment = template.experiment();
            let specs = specs(&experiment.control.law);
            let own = experiment.control.law == OWN;
            assert!(specs.is_empty() == own && !law_title(&experiment.control.law).is_empty());
            assert!(
                specs
                    .iter()
                    .all(|s| !title(s).contains('_') && !title(s).ends_with(" m")),
                "{template:?}"
            );
        }
    }
}
