//! Networks that are no policies, or none that may drive: refused with the reason. And one that drives.

use control::law::{Fault, FaultKind};
use control::scenario::Scenario;
use controllers::experiment::{rehearsal, rehearse_json};
use controllers::gallery::{POLICY, scenario_json};
use controllers::policy::{KEY, Policy};
use controllers::source::Source;
use onnx::{Message, Model, Sequence};
use serde_json::{Value, json};

fn manifest(change: impl FnOnce(&mut Value)) -> String {
    let mut manifest = json!({"format": "robopheus.policy/1", "observation": ["goal_forward_m", "goal_left_m"], "command": "twist",
        "rate_hz": 30, "limits": [0.3, 0.3, 1.5]});
    change(&mut manifest);
    manifest.to_string()
}

fn chain() -> Sequence {
    Sequence::new("observation", 2).linear(&[1.0, 0.0, 0.0, 0.0, 1.0, 2.0], &[0.0, 0.0, 0.0])
}

fn file(sequence: Sequence, manifest: &str) -> Vec<u8> {
    sequence.file("command", 3, &[(KEY, manifest)])
}

fn refused(bytes: &[u8], words: &str) {
    let reason = Policy::read(bytes).expect_err(words);
    assert!(reason.contains(words), "{reason:?} lacks {words:?}");
}

fn changed(change: impl FnOnce(&mut Model)) -> Vec<u8> {
    let mut model = chain().model("command", 3, &[(KEY, &manifest(|_| ()))]);
    change(&mut model);
    model.encode_to_vec()
}

/// Two seconds in the twin.
fn fault(bytes: &[u8]) -> Option<Fault> {
    let scenario = Scenario::from_json(&scenario_json(&Source::policy(bytes), 2.0)).expect("a scenario");
    let mut rehearsal = rehearsal(&scenario).unwrap_or_else(|problems| panic!("{problems:#?}"));
    while rehearsal.step() {}
    rehearsal.fault().cloned()
}

#[test]
fn everybody_comes_closer_to_the_targets() {
    let outcome = rehearse_json(&scenario_json(&Source::policy(POLICY), 40.0)).expect("a rehearsal");
    assert!(outcome.verdict.accepted, "{:#?}", outcome.verdict);
    let targets = [[0.6, 0.9], [-1.2, -0.7], [1.3, -0.6]];
    for (robot, [x_m, y_m]) in outcome.replay.robots.iter().zip(targets).take(2) {
        let [x, y, _] = *robot.poses.last().expect("a pose");
        assert!((x - x_m).hypot(y - y_m) < 0.08, "{}: {x} {y}", robot.name);
    }
}

#[test]
fn manifests_that_lie_are_refused() {
    let with = |change: fn(&mut Value)| file(chain(), &manifest(change));
    refused(&chain().file("command", 3, &[]), "it has no manifest");
    refused(&file(chain(), "{"), "cannot be read");
    refused(&with(|m| m["more"] = json!(1)), "unknown field");
    refused(
        &with(|m| m["format"] = json!("robopheus.policy/9")),
        "robopheus.policy/1",
    );
    refused(
        &with(|m| m["observation"] = json!(["goal_forward_m"])),
        "takes 2 numbers, its manifest names 1",
    );
    refused(&with(|m| m["observation"] = json!([])), "1 to 256");
    refused(
        &with(|m| m["command"] = json!("velocity")),
        "`limits` must be 2 numbers",
    );
    refused(
        &with(|m| (m["command"], m["limits"]) = (json!("velocity"), json!([1, 1]))),
        "gives 3 numbers",
    );
    refused(&with(|m| m["rate_hz"] = json!(50)), "must divide");
    refused(&with(|m| m["rate_hz"] = json!(0)), "must divide");
    refused(&with(|m| m["limits"] = json!([0.3, -0.3, 1.5])), "none negative");
    refused(&with(|m| m["reach_radius_m"] = json!(0.0)), "0.001 to 1");
    let unknown = with(|m| m["observation"] = json!(["goal_forward_m", "mood"]));
    let scenario = Scenario::from_json(&scenario_json(&Source::policy(&unknown), 2.0)).expect("a scenario");
    let problems = rehearsal(&scenario).expect_err("refused");
    assert!(
        problems[0].message.contains("`mood`") && problems[0].message.contains("goal_left_m"),
        "{problems:#?}"
    );
    assert_eq!(problems[0].field, "control.parameters.policy");
}

#[test]
fn networks_that_cannot_be_run_are_refused() {
    refused(b"", "no manifest");
    refused(b"not an onnx file", "no ONNX file");
    refused(&POLICY[..POLICY.len() / 2], "");
    let graph = |change: fn(&mut onnx::Graph)| changed(|model| change(model.graph.as_mut().expect("a graph")));
    refused(&changed(|model| model.graph = None), "no graph");
    refused(&changed(|model| model.opset_import[0].version = 9), "opset 9");
    refused(
        &changed(|model| model.opset_import[0].domain = "com.microsoft".into()),
        "com.microsoft",
    );
    refused(
        &graph(|graph| graph.input[0].name = "x".into()),
        "must be `observation`",
    );
    refused(&graph(|graph| graph.output[0].name = "y".into()), "must be `command`");
    refused(&graph(|graph| graph.output.clear()), "0 outputs");
    // Nothing times very much is nothing, and no reason to ask for that much memory.
    let hollow = |graph: &mut onnx::Graph| {
        let weights = &mut graph.initializer[0];
        weights.dims = vec![0, i64::MAX];
        weights.raw_data.clear();
        weights.float_data.clear();
    };
    refused(&graph(hollow), "holds nothing");
    refused(
        &graph(|graph| graph.node[0].op_type = "Loop".into()),
        "`Loop` is not among",
    );
    refused(&graph(|graph| graph.node[0].domain = "mine".into()), "`mine`");
    refused(
        &graph(|graph| graph.node[0].input[0] = "nobody".into()),
        "nobody gives it",
    );
    refused(
        &graph(|graph| graph.node[0].output[0] = "observation".into()),
        "given twice",
    );
    refused(
        &graph(|graph| graph.initializer[0].data_location = onnx::EXTERNAL),
        "another file",
    );
    refused(&graph(|graph| graph.initializer[0].data_type = 11), "element type 11");
    refused(
        &graph(|graph| graph.initializer[0].dims = vec![-1, 3]),
        "negative dimension",
    );
    refused(
        &graph(|graph| graph.initializer[0].dims = vec![i64::MAX, i64::MAX]),
        "asks for others",
    );
    refused(&graph(|graph| graph.initializer[0].dims = vec![3, 2]), "take 3 numbers");
    refused(
        &graph(|graph| graph.initializer[0].raw_data[..4].copy_from_slice(&f32::NAN.to_le_bytes())),
        "not finite",
    );
    refused(
        &graph(|graph| graph.node = vec![graph.node[0].clone(); 300]),
        "300 nodes",
    );
    let width = |change: fn(&mut onnx::Dimension)| {
        changed(|model| {
            let input = &mut model.graph.as_mut().expect("a graph").input[0];
            let tensor = input
                .kind
                .as_mut()
                .and_then(|kind| kind.tensor_type.as_mut())
                .expect("a tensor");
            change(&mut tensor.shape.as_mut().expect("a shape").dim[1]);
        })
    };
    refused(
        &width(|dim| (dim.dim_value, dim.dim_param) = (0, "n".into())),
        "fixed width",
    );
    refused(&width(|dim| dim.dim_value = 1_000_000), "1 to 4096");
    refused(
        &file(chain().node("Add", &["nobody"], &[]), &manifest(|_| ())),
        "nobody gives it",
    );
}

#[test]
fn a_network_that_takes_too_long_is_refused_before_it_runs() {
    let wide = Sequence::new("observation", 2)
        .linear(&vec![0.01; 2 * 400], &vec![0.0; 400])
        .linear(&vec![0.01; 400 * 500], &vec![0.0; 500])
        .linear(&vec![0.01; 500 * 3], &[0.0; 3]);
    let bytes = file(wide, &manifest(|_| ()));
    assert!(bytes.len() < control::law::own::MAX_POLICY_BYTES);
    let scenario = Scenario::from_json(&scenario_json(&Source::policy(&bytes), 2.0)).expect("a scenario");
    let problems = rehearsal(&scenario).expect_err("refused");
    assert!(problems[0].message.contains("operations for 3 robots"), "{problems:#?}");
}

#[test]
fn answers_that_are_no_numbers_stop_the_run_and_large_ones_are_cut() {
    let nan = file(chain().node("Sqrt", &[], &[]), &manifest(|_| ()));
    let fault = fault(&nan).expect("a fault");
    assert_eq!((fault.kind, fault.tick), (FaultKind::BadCommand, Some(0)), "{fault}");
    assert!(fault.reason.contains("NaN"), "{fault}");
    let huge = chain().constant("large", &[1], &[1e30]).node("Mul", &["large"], &[]);
    assert_eq!(told(&file(huge, &manifest(|_| ()))), None);
}

fn told(bytes: &[u8]) -> Option<String> {
    fault(bytes).map(|fault| fault.to_string())
}

/// Random changes of a good file: every answer is an error or a policy, and a policy can be evaluated.
#[test]
fn damaged_files_are_no_harm() {
    let mut state = 7_u64;
    let mut draw = move |most: usize| {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (state >> 33) as usize % most.max(1)
    };
    let (mut read, mut refused) = (0, 0);
    for _ in 0..20_000 {
        let mut bytes = POLICY.to_vec();
        for _ in 0..=draw(4) {
            let at = draw(bytes.len());
            match draw(8) {
                0 => bytes.truncate(at.max(1)),
                1 => bytes.insert(at, draw(256) as u8),
                _ => bytes[at] ^= 1 << draw(8),
            }
        }
        match Policy::read(&bytes) {
            Ok(mut policy) => {
                policy.network.input_mut().fill(0.5);
                let _answer = policy.network.evaluate();
                read += 1;
            }
            Err(_) => refused += 1,
        }
    }
    assert!(read > 500 && refused > 5000, "{read} {refused}");
}
