"""A second robot: the rules of docs/link.md around a kinematic omni robot, in plain Python (3.11 or newer, nothing to install).

    python3 robot.py --number 1 --key-file link-keys.json --port 9001 [--pose=-1,0.5,0] [--tracker /path/tracker.sock]

It obeys commands (single and in groups), keeps the watchdog, and sends telemetry, health and counters. With --tracker it also
plays the tracker for itself, in the format of the emulated laboratory. Targets and fixes are left out: it counts them as unknown.
"""

import argparse
import json
import math
import os
import select
import socket
import time

import link

RATE_HZ = 480
TELEMETRY_EVERY = 4
HEALTH_EVERY = 48
COUNTERS_EVERY = 480
MAX_AGE_MS = 50.0
RAMP_AFTER_MS, LATCH_AFTER_MS, RAMP_RAD_PER_S2 = 100, 500, 40.0
RADIUS_M, ARM_M = 0.05, 0.12 * math.sqrt(2.0)
PLACES_RAD = [math.pi / 4 * (2 * wheel + 1) for wheel in range(4)]
WRAP = 1 << 32


def signed(difference):
    """A difference of wrapping clocks."""
    return (difference + WRAP // 2) % WRAP - WRAP // 2


class ClockOffset:
    """Peer clock minus own clock as an interval, milliseconds; see docs/link.md, Clocks."""

    def __init__(self):
        self.interval = None

    def observe(self, own_ms, peer_ms, echo_ms):
        round_trip = (own_ms - echo_ms) % WRAP
        if echo_ms == 0 or round_trip > 2000:
            return
        reference = self.interval[0] if self.interval else (peer_ms - own_ms) % WRAP
        low = signed(peer_ms - own_ms - reference) - 1.0
        high = signed(peer_ms - echo_ms - reference) + 1.0
        old = self.at(own_ms)
        if old and old[1] <= high and low <= old[2]:
            low, high = max(low, old[1]), min(high, old[2])
        self.interval = (reference, low, high, own_ms)

    def at(self, own_ms):
        if self.interval is None:
            return None
        reference, low, high, updated_ms = self.interval
        elapsed = max(0, signed(own_ms - updated_ms))
        if elapsed > 2000:
            return None
        drift = elapsed * 200e-6 + 0.001
        return reference, low - drift, high + drift

    def age_ms(self, own_ms, peer_ms):
        """Largest age of a time stamp; None while too little is known."""
        interval = self.at(own_ms)
        if interval is None or (interval[2] - interval[1]) / 2 > 15.0:
            return None
        reference, low, high = interval
        return signed(own_ms + reference - peer_ms) + (low + high) / 2 + (high - low) / 2 + 1.0


class Refused(Exception):
    """An authentic frame that may not move the robot; the argument is its counter."""


class Watchdog:
    """Ramps to zero without fresh set-points, and latches."""

    def __init__(self):
        self.state, self.stopped, self.enabled = "latched", False, False
        self.epoch, self.accepted_ms, self.stepped_ms = None, 0, None
        self.held, self.steering_rad, self.gain = [0.0] * 4, 0.0, 0.0

    def accept(self, command, epoch, now_ms):
        if command["clear"] or self.epoch != epoch:
            self.state, self.stopped = "running", False
        if self.state == "ramping":
            self.state = "running"
        self.epoch, self.accepted_ms, self.enabled = epoch, now_ms, command["enable"]
        if command["stop"]:
            self.stop(epoch)
        elif command["enable"] and self.state == "running":
            self.held, self.steering_rad = command["wheel_rad_per_s"], command["steering_rad"]

    def stop(self, epoch):
        self.state, self.stopped, self.epoch = "latched", True, epoch

    def step(self, now_ms):
        since = 0 if self.stepped_ms is None else max(0, signed(now_ms - self.stepped_ms))
        self.stepped_ms = now_ms
        silence, closing = max(0, signed(now_ms - self.accepted_ms)), since
        if self.state != "latched":
            if silence > RAMP_AFTER_MS:
                self.state = "ramping"
                closing = min(since, silence - RAMP_AFTER_MS)
            if silence >= LATCH_AFTER_MS:
                self.state = "latched"
        per_ms = RAMP_RAD_PER_S2 / max(1e-6, *map(abs, self.held)) / 1000.0
        if self.state == "running" and self.enabled:
            self.gain = min(1.0, self.gain + per_ms * since)
        else:
            self.gain = max(0.0, self.gain - per_ms * closing)
        return [speed * self.gain for speed in self.held]


class Robot:
    """Rules of acceptance, watchdog and a body whose wheels do at once what they are told."""

    def __init__(self, number, key):
        self.number, self.key = number, key
        self.largest, self.clock, self.watchdog = None, ClockOffset(), Watchdog()
        self.counters = dict.fromkeys(link.COUNTER_NAMES, 0)
        self.heard_ms = self.applied_sequence = self.applied_tick = self.sent = 0
        self.speeds, self.angles, self.pose, self.twist = [0.0] * 4, [0.0] * 4, [0.0] * 3, (0.0, 0.0, 0.0)

    def receive(self, characters, now_ms):
        """`commander`, `probe` or `nothing`: whether and how the sender is answered."""
        try:
            self.accept(characters, now_ms)
        except link.FrameError as error:
            self.counters[error.reason] += 1
            return "nothing"
        except Refused as refusal:
            reason = refusal.args[0]
            self.counters[reason] += 1
            in_order = reason in ("clock_unknown", "stale")
            return "commander" if in_order else "probe" if reason in ("old_epoch", "out_of_order") else "nothing"
        self.counters["accepted"] += 1
        return "commander"

    def accept(self, characters, now_ms):
        header, kind, command = link.decode(characters, self.number, self.key)
        if header["robot"] != self.number or kind in (link.TELEMETRY, link.HEALTH, link.COUNTERS):
            raise Refused("not_for_this_robot")
        if kind != link.COMMAND:
            raise link.FrameError("unknown", f"type {kind} is not built in")
        epoch, sequence = header["epoch"], header["sequence"]
        if self.largest:
            if epoch < self.largest[0]:
                raise Refused("old_epoch")
            if epoch == self.largest[0] and sequence <= self.largest[1]:
                raise Refused("out_of_order")
            if epoch > self.largest[0]:
                self.clock = ClockOffset()
        self.largest = (epoch, sequence)
        self.clock.observe(now_ms, header["clock_ms"], header["echo_ms"])
        self.heard_ms = header["clock_ms"]
        if command["stop"]:
            self.watchdog.stop(epoch)
        age_ms = self.clock.age_ms(now_ms, header["clock_ms"])
        if age_ms is None:
            raise Refused("clock_unknown")
        if age_ms > MAX_AGE_MS:
            raise Refused("stale")
        self.watchdog.accept(command, epoch, now_ms)
        self.applied_sequence, self.applied_tick = sequence, header["tick"]

    def step(self, now_ms, period_s):
        self.speeds = self.watchdog.step(now_ms)
        rims = [RADIUS_M * speed for speed in self.speeds]
        # Tangential wheels at 45 degrees: rim = -u sin p + v cos p + r d.
        u = -sum(rim * math.sin(place) for rim, place in zip(rims, PLACES_RAD)) / 2
        v = sum(rim * math.cos(place) for rim, place in zip(rims, PLACES_RAD)) / 2
        r = sum(rims) / (4 * ARM_M)
        x, y, yaw = self.pose
        middle = yaw + r * period_s / 2
        self.pose = [
            x + period_s * (u * math.cos(middle) - v * math.sin(middle)),
            y + period_s * (u * math.sin(middle) + v * math.cos(middle)),
            yaw + period_s * r,
        ]
        self.angles = [angle + period_s * speed for angle, speed in zip(self.angles, self.speeds)]
        self.twist = (u, v, r)

    def header(self, now_ms, echo_ms):
        self.sent = (self.sent + 1) % WRAP
        epoch = self.largest[0] if self.largest else 0
        return dict(
            robot=self.number, epoch=epoch, sequence=self.sent, tick=self.applied_tick, clock_ms=now_ms, echo_ms=echo_ms
        )

    def status(self, now_ms):
        state = self.watchdog.state
        return dict(
            running=state == "running" and self.watchdog.enabled,
            ramping=state == "ramping",
            latched=state == "latched",
            clock_known=self.clock.age_ms(now_ms, self.heard_ms) is not None,
            stopped=self.watchdog.stopped,
        )

    def telemetry(self, now_ms, echo=True):
        measured = dict(
            status=self.status(now_ms),
            applied_sequence=self.applied_sequence,
            wheel_rad_per_s=self.speeds,
            wheel_rad=self.angles,
            current_a=[0.0] * 4,
            bus_v=24.0,
            gyro_z_rad_per_s=self.twist[2],
            accel_m_per_s2=[0.0, 0.0],
            steering_rad=0.0,
        )
        return link.encode_telemetry(self.header(now_ms, self.heard_ms if echo else 0), measured, self.key)

    def health(self, now_ms):
        x, y, yaw = self.pose
        estimate = dict(
            status=self.status(now_ms),
            battery=0,
            x_m=x,
            y_m=y,
            yaw_rad=math.remainder(yaw, math.tau),
            forward_m_per_s=self.twist[0],
            left_m_per_s=self.twist[1],
            yaw_rate_rad_per_s=self.twist[2],
            # Dead reckoning from nowhere: not anchored, and as unknown as the field can say.
            position_sd_m=math.inf,
            yaw_sd_rad=math.inf,
            gyro_bias_rad_per_s=0.0,
            rest_v=24.0,
        )
        return link.encode_health(self.header(now_ms, self.heard_ms), estimate, self.key)

    def count_report(self, now_ms):
        return link.encode_counters(self.header(now_ms, self.heard_ms), self.counters, self.key)


class Tracker:
    """The stream of the emulated laboratory's tracker: one JSON line a picture to every reader."""

    def __init__(self, path):
        if os.path.exists(path):
            os.unlink(path)
        self.listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.listener.bind(path)
        os.chmod(path, 0o600)
        self.listener.listen()
        self.listener.setblocking(False)
        self.readers, self.frame = [], 0

    def send(self, robot):
        try:
            reader, _ = self.listener.accept()
            reader.setblocking(False)
            self.readers.append(reader)
        except BlockingIOError:
            pass
        x, y, yaw = robot.pose
        pose = dict(number=robot.number, x_m=x, y_m=y, yaw_rad=math.remainder(yaw, math.tau))
        now_us = time.monotonic_ns() // 1000
        picture = dict(frame=self.frame, camera="tracker", exposure_us=now_us, sent_us=now_us, poses=[pose])
        self.frame += 1
        line = json.dumps(picture).encode() + b"\n"
        for reader in list(self.readers):
            try:
                reader.sendall(line)
            except OSError:
                self.readers.remove(reader)


def serve(robot, port, tracker=None, end=lambda: False, host="127.0.0.1"):
    """Runs the robot on a UDP port of this host until `end` says so."""
    link_socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    link_socket.bind((host, port))
    link_socket.setblocking(False)
    start, done, commander = time.monotonic(), 0, None
    now_ms = lambda: time.monotonic_ns() // 1_000_000 % WRAP or 1
    while not end():
        rest = start + (done + 1) / RATE_HZ - time.monotonic()
        if rest > 0 and select.select([link_socket], [], [], rest)[0]:
            try:
                characters, sender = link_socket.recvfrom(2048)
            except OSError:
                continue
            answer = robot.receive(characters, now_ms())
            if answer == "commander":
                commander = sender
            elif answer == "probe":
                link_socket.sendto(robot.telemetry(now_ms(), echo=False), sender)
            continue
        done += 1
        robot.step(now_ms(), 1 / RATE_HZ)
        frames = []
        if done % TELEMETRY_EVERY == 0:
            frames.append(robot.telemetry(now_ms()))
            if tracker:
                tracker.send(robot)
        if done % HEALTH_EVERY == 0:
            frames.append(robot.health(now_ms()))
        if done % COUNTERS_EVERY == 0:
            frames.append(robot.count_report(now_ms()))
        for frame in frames if commander else []:
            try:
                link_socket.sendto(frame, commander)
            except OSError:
                pass


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--number", type=int, required=True)
    parser.add_argument("--key-file", required=True, help="JSON of robot numbers and 32 hexadecimal digits")
    parser.add_argument("--port", type=int, required=True)
    parser.add_argument("--host", default="127.0.0.1", help="own address on which to listen, 0.0.0.0 for all")
    parser.add_argument("--pose", default="0,0,0", help="where it stands: x m, y m, yaw rad")
    parser.add_argument("--tracker", help="socket on which to play the tracker")
    arguments = parser.parse_args()
    with open(arguments.key_file, encoding="ascii") as file:
        key = bytes.fromhex(json.load(file)[str(arguments.number)])
    tracker = Tracker(arguments.tracker) if arguments.tracker else None
    robot = Robot(arguments.number, key)
    x, y, yaw = map(float, arguments.pose.split(","))
    robot.pose = [x, y, yaw]
    serve(robot, arguments.port, tracker, host=arguments.host)


if __name__ == "__main__":
    main()
