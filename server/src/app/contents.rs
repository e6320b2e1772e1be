//! What a model version contains, with the units that its document leaves out.

use api::model::{ModelEffect, ModelGap, ModelParameter, ModelResidual, ModelView};
use serde_json::Value;
use twin::effect::Effect;
use twin::effect::library::find;
use twin::residual::ResidualDocument;

/// Fills in what is read from the document. What this version of the service does not understand is left out: the document
/// itself stays whole.
pub fn described(mut view: ModelView) -> ModelView {
    let part = |name: &str| view.document.get(name).cloned().unwrap_or(Value::Null);
    let effects: Vec<Effect> = serde_json::from_value(part("effects")).unwrap_or_default();
    let residual: Option<ResidualDocument> = serde_json::from_value(part("residual")).ok().flatten();
    view.effects = effects.iter().map(effect).collect();
    view.residual = residual.as_ref().map(network);
    view.gap = view.gap.or_else(|| learned_gap(&part("provenance")));
    view
}

fn effect(effect: &Effect) -> ModelEffect {
    let entry = find(&effect.name);
    let parameter = |(name, value): (&String, &Option<f64>)| ModelParameter {
        name: name.clone(),
        value: *value,
        unit: entry
            .and_then(|entry| entry.parameter(name))
            .map(|known| known.unit.to_owned())
            .unwrap_or_default(),
    };
    ModelEffect {
        name: effect.name.clone(),
        index: effect.index,
        parameters: effect.parameters.iter().map(parameter).collect(),
    }
}

fn network(residual: &ResidualDocument) -> ModelResidual {
    ModelResidual {
        inputs: residual.inputs.iter().map(|input| input.name.clone()).collect(),
        outputs: residual.outputs.iter().map(|output| output.name.clone()).collect(),
        weights: residual
            .layers
            .iter()
            .map(|layer| layer.weights.len() + layer.bias.len())
            .sum(),
    }
}

/// Figures of a version that was learned in a run: predictions half a second ahead, made before their ends were seen.
fn learned_gap(provenance: &Value) -> Option<ModelGap> {
    let closing = provenance.get("learned_online")?.get("closing")?;
    let figure = |name: &str| closing.get(name).and_then(Value::as_f64);
    Some(ModelGap {
        horizon_s: learn::online::HORIZON_STEPS as f64 / f64::from(twin::PHYSICS_RATE_HZ),
        before_m: figure("parent_rms_m")?,
        after_m: figure("learnt_rms_m")?,
    })
}
