"""Makes the golden frames of tests/fixtures/link-frames.txt from their values, and checks a file of them.

`python3 golden.py PATH` reads every line back and compares it with what this implementation makes; exit 1 on a difference.
"""

import sys

import link

KEY = bytes(range(16))
HEADER = dict(robot=1, epoch=7, sequence=42, tick=41, clock_ms=1_000_000, echo_ms=990_000)
DRIVE = dict(enable=True, wheel_rad_per_s=[12.34, -12.34, 0.01, -0.01], steering_rad=0.1234)
LARGEST = 0xFFFFFFFF


def key_of(robot):
    """Robot 1 has the golden key; of every other the first byte is its number."""
    return KEY if robot == 1 else bytes([robot]) + KEY[1:]


def at(sequence, **more):
    return HEADER | dict(sequence=sequence) | more


def frames():
    """Name and characters of every golden frame."""
    ends = dict(robot=250, epoch=LARGEST, sequence=LARGEST, tick=LARGEST, clock_ms=LARGEST, echo_ms=LARGEST)
    still = dict(wheel_rad_per_s=[0.0] * 4, wheel_rad=[0.0] * 4, current_a=[0.0] * 4, accel_m_per_s2=[0.0] * 2)
    yield "command drive", link.encode_command(HEADER, DRIVE, KEY)
    yield "command stop", link.encode_command(at(43), dict(stop=True), KEY)
    yield "command clear", link.encode_command(at(44), dict(clear=True), KEY)
    wheels = [327.67, -327.68, 327.67, -327.68]
    yield "command largest", link.encode_command(
        ends, dict(enable=True, wheel_rad_per_s=wheels, steering_rad=3.2767), KEY
    )
    measured = dict(
        status=dict(running=True, clock_known=True),
        applied_sequence=42,
        wheel_rad_per_s=[12.3, -12.31, 0.0, 0.05],
        wheel_rad=[1234.567, -1234.567, 0.001, 0.0],
        current_a=[1.25, -1.25, 0.03, 9.0],
        bus_v=23.987,
        gyro_z_rad_per_s=-0.512,
        accel_m_per_s2=[0.25, -1.5],
        steering_rad=-0.25,
    )
    yield "telemetry driving", link.encode_telemetry(at(99), measured, KEY)
    latched = still | dict(
        status=dict(latched=True), applied_sequence=0, bus_v=24.0, gyro_z_rad_per_s=0.0, steering_rad=0.0
    )
    begin = dict(robot=6, epoch=0, sequence=1, tick=0, clock_ms=1, echo_ms=0)
    yield "telemetry latched", link.encode_telemetry(begin, latched, KEY)
    shared = dict(epoch=7, sequence=45, tick=41, clock_ms=1_000_000)
    slow = dict(enable=True, wheel_rad_per_s=[1.0, 2.0, 3.0, 4.0])
    yield "group one", link.encode_group(shared, [(1, 990_000, DRIVE)], key_of)
    three = [(1, 990_000, DRIVE), (2, 0, dict(stop=True)), (9, 77, slow)]
    yield "group three", link.encode_group(shared | dict(sequence=46), three, key_of)
    full = [(robot, robot, slow) for robot in range(1, 17)]
    yield "group full", link.encode_group(shared | dict(sequence=47), full, key_of)
    health = dict(
        status=dict(running=True, clock_known=True),
        battery=1,
        anchored=True,
        bounded=True,
        x_m=1.2345,
        y_m=-0.9876,
        yaw_rad=3.1415,
        forward_m_per_s=0.5,
        left_m_per_s=-0.125,
        yaw_rate_rad_per_s=-0.75,
        position_sd_m=0.0021,
        yaw_sd_rad=0.0034,
        gyro_bias_rad_per_s=-0.00405,
        rest_v=23.456,
    )
    yield "health driving", link.encode_health(at(100), health, KEY)
    lost = health | dict(
        status=dict(latched=True, stopped=True),
        battery=3,
        anchored=False,
        bounded=False,
        stalled=True,
        sensor_fault=True,
        position_sd_m=10.0,
        yaw_sd_rad=1.8,
    )
    yield "health lost", link.encode_health(at(101), lost, KEY)
    counters = {name: 1000 * place for place, name in enumerate(link.COUNTER_NAMES, start=1)} | dict(stale=LARGEST)
    yield "counters", link.encode_counters(at(102), counters, KEY)
    bounds = dict(speed_cap_m_per_s=0.6, yaw_rate_cap_rad_per_s=1.5, region=[-1.75, 1.75, -1.25, 1.25], expiry_ms=80)
    twist = bounds | dict(enable=True, aim=("twist", 0.5, -0.25, 0.75))
    yield "target twist", link.encode_target(at(48), twist, KEY)
    pose = bounds | dict(enable=True, clear=True, aim=("pose", 1.5, -1.0, -1.5708), expiry_ms=100)
    yield "target pose", link.encode_target(at(49), pose, KEY)
    fix = dict(x_m=1.2345, y_m=-0.9876, yaw_rad=-3.1415, exposure_ms=999_990, position_sd_m=0.0015, yaw_sd_rad=0.003)
    yield "fix", link.encode_fix(at(50), fix, KEY)


def check(path):
    """Differences between a file and what this implementation makes and reads."""
    with open(path, encoding="ascii") as file:
        lines = [line.rstrip("\n") for line in file if not line.startswith("#")]
    golden = dict(line.split(" :", 1) for line in lines if " :" in line)
    made = {name: characters.decode()[1:-1] for name, characters in frames()}
    problems = [f"{name}: not in the file" for name in made if name not in golden]
    for name, digits in golden.items():
        if made.get(name) != digits:
            problems.append(f"{name}: made {made.get(name)}, the file has {digits}")
        robot = 1 if name.startswith("group") else bytes.fromhex(digits)[2]
        link.decode(f":{digits}\n".encode(), robot, KEY)
    return golden, problems


if __name__ == "__main__":
    if len(sys.argv) == 1:
        for name, characters in frames():
            print(name, characters.decode(), end="")
    else:
        golden, problems = check(sys.argv[1])
        print("\n".join(problems) or f"{len(golden)} golden frames agree")
        sys.exit(1 if problems else 0)
