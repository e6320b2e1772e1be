//! A file with an own controller, put into an experiment document.

use anyhow::{Context, bail};
use api::experiment::Experiment;
use control::law::own::{MODULE, POLICY, SCRIPT};
use controllers::source::Source;
use std::path::Path;

/// First bytes of every WebAssembly module.
const MODULE_MAGIC: &[u8] = b"\0asm";
const POLICY_ENDING: &str = "onnx";
/// Every key that a program may stand under.
const KEYS: [&str; 3] = [SCRIPT, MODULE, POLICY];

/// An experiment document, with the program of a file as its law when there is one.
///
/// - `program`: a WebAssembly module (known by its first bytes), a policy (`.onnx`), or else a script.
pub fn experiment(document: &Path, program: Option<&Path>) -> anyhow::Result<Experiment> {
    let text = std::fs::read_to_string(document).with_context(|| format!("cannot read {}", document.display()))?;
    let mut experiment: Experiment = serde_json::from_str(&text).with_context(|| format!("{}", document.display()))?;
    if let Some(program) = program {
        install(&mut experiment, &source(program)?).with_context(|| format!("{}", program.display()))?;
    }
    Ok(experiment)
}

/// What is in a file.
fn source(path: &Path) -> anyhow::Result<Source> {
    let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    let is_policy = path
        .extension()
        .is_some_and(|ending| ending.eq_ignore_ascii_case(POLICY_ENDING));
    let source = if bytes.starts_with(MODULE_MAGIC) {
        Source::module(&bytes)
    } else if is_policy {
        Source::policy(&bytes)
    } else if let Ok(text) = String::from_utf8(bytes) {
        Source::Script(text)
    } else {
        bail!(
            "{}: neither a WebAssembly module (it would begin with \\0asm) nor a script (it is no UTF-8 text); a policy's name ends in .{POLICY_ENDING}",
            path.display()
        );
    };
    // Too large a file is refused here, before it is sent anywhere.
    source
        .bytes()
        .map_err(|fault| anyhow::anyhow!("{}: {fault}", path.display()))?;
    Ok(source)
}

/// The program takes the place of the law; parameters that are numbers stay, for the program to read.
fn install(experiment: &mut Experiment, source: &Source) -> anyhow::Result<()> {
    let (Source::Script(text) | Source::Module(text) | Source::Policy(text)) = source;
    let control = &mut experiment.control;
    let was_own = control.law == "own";
    if control.parameters.is_null() {
        control.parameters = serde_json::json!({});
    }
    let Some(parameters) = control.parameters.as_object_mut() else {
        bail!(
            "control.parameters of the experiment is {}, not an object",
            control.parameters
        );
    };
    parameters.retain(|key, value| !KEYS.contains(&key.as_str()) && (was_own || value.is_number()));
    parameters.insert(source.key().to_owned(), text.clone().into());
    "own".clone_into(&mut control.law);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use controllers::gallery;

    const DOCUMENT: &str = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../examples/controllers/avoid-each-other.json"
    );

    fn with(name: &str, bytes: &[u8]) -> anyhow::Result<Experiment> {
        let folder = std::env::temp_dir().join(format!("robopheus-program-{}", std::process::id()));
        std::fs::create_dir_all(&folder)?;
        let path = folder.join(name);
        std::fs::write(&path, bytes)?;
        let experiment = experiment(Path::new(DOCUMENT), Some(&path));
        std::fs::remove_file(path)?;
        // Another test may have a file in it still.
        let _in_use = std::fs::remove_dir(folder);
        experiment
    }

    #[test]
    fn each_kind_of_file_takes_the_place_of_the_law() {
        for (name, bytes, key) in [
            ("a.rhai", b"fn step(now) { }".as_slice(), "script"),
            ("a.wasm", gallery::MODULE, "module"),
            ("module-without-ending", gallery::MODULE, "module"),
            ("a.onnx", gallery::POLICY, "policy"),
        ] {
            let mut experiment = with(name, bytes).expect("an experiment");
            assert_eq!(experiment.control.law, "own");
            assert!(experiment.control.parameters[key].is_string(), "{name}");
            assert_eq!(experiment.control.parameters["speed_m_per_s"], 0.35, "numbers stay");
            // A second one takes the place of the first.
            install(&mut experiment, &Source::Script("fn step(now) {}".into())).expect("installed");
            let keys = KEYS
                .iter()
                .filter(|key| experiment.control.parameters.get(**key).is_some());
            assert_eq!(keys.count(), 1, "{name}");
        }
    }

    #[test]
    fn what_is_no_program_is_refused_with_its_name() {
        for (name, bytes, words) in [
            ("a.bin", [0xff, 0xfe, 0x00].repeat(10), "neither a WebAssembly module"),
            ("a.rhai", vec![b' '; 65_537], "65537 bytes"),
            ("b.wasm", [MODULE_MAGIC, &[0; 1 << 20]].concat(), "bytes"),
            ("c.rhai", Vec::new(), "0 bytes"),
        ] {
            let error = format!("{:#}", with(name, &bytes).expect_err("refused"));
            assert!(error.contains(words) && error.contains(name), "{error}");
        }
        assert!(experiment(Path::new(DOCUMENT), Some(Path::new("/nowhere/a.rhai"))).is_err());
    }
}
