#!/usr/bin/env python3
"""Predicts where a robot goes, with the learned residual of `robopheus-learn train` and a few lines of physics.

    pip install onnxruntime
    python predict.py OUT BUNDLE [START_S]

OUT is the folder that `train` wrote, BUNDLE a run bundle (run.json, telemetry.csv) of the same robot with wheel speeds and
poses. The wheels are driven as the log says; the body follows from contact forces (docs/notation.md, loads at rest) and the
network's accelerations. Prints the error of the predicted place 0.5, 1 and 2 s after START_S, with and without the network.
"""

import csv
import json
import math
import sys
from pathlib import Path

import numpy
import onnxruntime

GRAVITY = 9.80665
SLIP_M_PER_S = 0.02
STEP_S = 1e-4  # the contact is stiff
TICK_S = 1.0 / 120.0
HORIZONS_S = (0.5, 1.0, 2.0)


class Log:
    """Columns of telemetry.csv; between samples a value holds."""

    def __init__(self, folder):
        with open(Path(folder) / "telemetry.csv", newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        self.columns = {}
        for name in rows[0]:
            pairs = [(float(row["time_s"]), float(row[name])) for row in rows if row[name] != ""]
            self.columns[name] = numpy.array(pairs).T if pairs else None

    def held(self, name, time_s, default=0.0):
        column = self.columns.get(name)
        if column is None:
            return default
        at = numpy.searchsorted(column[0], time_s + 1e-9, side="right") - 1
        return float(column[1][at]) if at >= 0 else default

    def line(self, name, time_s):
        column = self.columns[name]
        return float(numpy.interp(time_s, column[0], column[1]))

    def pose(self, time_s, half_s=0.1):
        """Pose and velocity in the world by straight lines over 0.2 s."""
        out = []
        for name in ("pose_x_m", "pose_y_m", "pose_yaw_rad"):
            times, values = self.columns[name]
            near = abs(times - time_s) <= half_s
            values = numpy.unwrap(values[near]) if name == "pose_yaw_rad" else values[near]
            slope, value = numpy.polyfit(times[near] - time_s, values, 1)
            out.append((value, slope))
        return [value for value, _ in out], [slope for _, slope in out]


class Network:
    """The ONNX file with the meaning of its inputs."""

    def __init__(self, path):
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1
        self.session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
        told = self.session.get_modelmeta().custom_metadata_map
        self.inputs = json.loads(told["inputs"])
        self.outputs = [output["name"] for output in json.loads(told["outputs"])]
        self.past = []

    def accelerations(self, now):
        """Forward, left, yaw; `now` by name. To be called every 1/120 s."""
        self.past.append(now)
        row = []
        for entry in self.inputs:
            ago = entry["ticks_ago"]
            name = entry["name"].removesuffix(f"_{ago}_ticks_ago")
            row.append(self.past[max(0, len(self.past) - 1 - ago)][name])
        (found,) = self.session.run(["acceleration"], {"state": numpy.array([row], dtype=numpy.float32)})
        by_name = dict(zip(self.outputs, found[0].tolist()))
        names = ("acceleration_forward_m_per_s2", "acceleration_left_m_per_s2", "acceleration_yaw_rad_per_s2")
        return [by_name.get(name, 0.0) for name in names]


def contact(robot, wheel, speed, steering, u, v, r):
    """Force of a wheel on the body, forward and left, N."""
    if wheel["kind"] == "caster":
        return 0.0, 0.0
    beta = wheel["rolling_direction_rad"] + (steering if wheel["steered"] else 0.0)
    c, s = math.cos(beta), math.sin(beta)
    px, py = u - r * wheel["y_m"], v + r * wheel["x_m"]
    along = wheel["radius_m"] * speed - (c * px + s * py) if wheel["driven"] else 0.0
    across = 0.0 if wheel["kind"] == "omni" else s * px - c * py
    slip = math.hypot(along, across)
    if slip == 0.0:
        return 0.0, 0.0
    load = robot["mass_kg"] * GRAVITY / len(robot["wheels"])
    force = robot["floor_friction"] * load * math.tanh(slip / SLIP_M_PER_S) / slip
    return force * (along * c - across * s), force * (along * s + across * c)


def predict(robot, log, start_s, network=None):
    """Poses every 1/120 s for two seconds."""
    (x, y, yaw), (vx, vy, r) = log.pose(start_s)
    u, v = vx * math.cos(yaw) + vy * math.sin(yaw), vy * math.cos(yaw) - vx * math.sin(yaw)
    poses, wheels = [(x, y, yaw)], robot["wheels"]
    for tick in range(int(max(HORIZONS_S) / TICK_S)):
        time_s = start_s + tick * TICK_S
        speeds = [log.line(f"wheel_{k}_rad_per_s", time_s) if wheel["driven"] else 0.0 for k, wheel in enumerate(wheels)]
        steering = log.held("steering_rad", time_s, log.held("command_steering_rad", time_s))
        push = [0.0, 0.0, 0.0]
        if network:
            now = {"forward_m_per_s": u, "left_m_per_s": v, "yaw_rate_rad_per_s": r}
            now |= {"yaw_rate_times_forward_m_per_s2": r * u, "steering_rad": steering}
            now |= {"x_m": x, "y_m": y, "heading_cos": math.cos(yaw), "heading_sin": math.sin(yaw)}
            now["command_steering_rad"] = log.held("command_steering_rad", time_s)
            for k, speed in enumerate(speeds):
                now[f"wheel_{k}_rad_per_s"] = speed
                now[f"command_wheel_{k}_rad_per_s"] = log.held(f"command_wheel_{k}_rad_per_s", time_s)
            push = network.accelerations(now)
        for _ in range(round(TICK_S / STEP_S)):
            force = [0.0, 0.0, 0.0]
            for wheel, speed in zip(wheels, speeds):
                fx, fy = contact(robot, wheel, speed, steering, u, v, r)
                force[0] += fx
                force[1] += fy
                force[2] += wheel["x_m"] * fy - wheel["y_m"] * fx
            u, v, r = (
                u + STEP_S * (force[0] / robot["mass_kg"] + push[0] + r * v),
                v + STEP_S * (force[1] / robot["mass_kg"] + push[1] - r * u),
                r + STEP_S * (force[2] / robot["yaw_inertia_kg_m2"] + push[2]),
            )
            x += STEP_S * (u * math.cos(yaw) - v * math.sin(yaw))
            y += STEP_S * (u * math.sin(yaw) + v * math.cos(yaw))
            yaw += STEP_S * r
        poses.append((x, y, yaw))
    return poses


def main():
    out, bundle = Path(sys.argv[1]), Path(sys.argv[2])
    start_s = float(sys.argv[3]) if len(sys.argv) > 3 else 2.0
    robot = json.loads((out / "model.json").read_text(encoding="utf-8"))["robot"]
    log = Log(bundle)
    alone = predict(robot, log, start_s)
    learned = predict(robot, log, start_s, Network(out / "model.onnx"))
    for horizon_s in HORIZONS_S:
        (x, y, _), _ = log.pose(start_s + horizon_s)
        at = round(horizon_s / TICK_S)
        errors = [math.hypot(path[at][0] - x, path[at][1] - y) for path in (alone, learned)]
        print(f"{horizon_s:.1f} s ahead: {errors[0]:.4f} m by physics alone, {errors[1]:.4f} m with the learned residual")


if __name__ == "__main__":
    main()
