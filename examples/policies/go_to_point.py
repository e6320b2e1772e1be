#!/usr/bin/env python3
"""Makes a policy: a network that goes to a point, with its manifest inside.

    pip install onnx numpy
    python3 go_to_point.py go_to_point.onnx experiment.json

The second file is an experiment with the policy in it, made from examples/experiments/rectangle-omni4.json; try it by
`robopheus validate experiment.json --lab examples/lab/reference.json`. A network that was trained elsewhere needs the same:
one input `observation` [1, n], one output `command` [1, 3] or [1, 2], float32, and the manifest in `metadata_props`.
"""

import base64
import json
import pathlib
import sys

import numpy
import onnx
from onnx import TensorProto, helper, numpy_helper

MANIFEST = {
    "format": "robopheus.policy/1",
    # What the network sees, in this order: the target in the robot's own frame, m.
    "observation": ["goal_forward_m", "goal_left_m"],
    # What it says: forward m/s, left m/s, yaw rate rad/s.
    "command": "twist",
    "rate_hz": 30,
    "limits": [0.3, 0.3, 1.5],
}


def network():
    # tanh of three sums: 2 forward, 2 left, 4 left.
    weights = numpy.array([[2.0, 0.0, 0.0], [0.0, 2.0, 4.0]], dtype=numpy.float32)
    scale = numpy.array([[0.3, 0.3, 1.5]], dtype=numpy.float32)
    constants = {"weights": weights, "scale": scale}
    graph = helper.make_graph(
        [
            helper.make_node("MatMul", ["observation", "weights"], ["sums"]),
            helper.make_node("Tanh", ["sums"], ["bounded"]),
            helper.make_node("Mul", ["bounded", "scale"], ["command"]),
        ],
        "go to point",
        [helper.make_tensor_value_info("observation", TensorProto.FLOAT, [1, 2])],
        [helper.make_tensor_value_info("command", TensorProto.FLOAT, [1, 3])],
        [numpy_helper.from_array(values, name) for name, values in constants.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    helper.set_model_props(model, {"robopheus.policy": json.dumps(MANIFEST)})
    onnx.checker.check_model(model)
    return model.SerializeToString()


def main():
    policy_path, experiment_path = map(pathlib.Path, sys.argv[1:3])
    policy = network()
    policy_path.write_bytes(policy)
    examples = pathlib.Path(__file__).resolve().parent.parent / "experiments"
    experiment = json.loads((examples / "rectangle-omni4.json").read_text())
    experiment["control"] = {"law": "own", "parameters": {"policy": base64.b64encode(policy).decode()}}
    experiment_path.write_text(json.dumps(experiment, indent=1))
    print(f"{policy_path}: {len(policy)} bytes; {experiment_path} drives by it")


if __name__ == "__main__":
    main()
