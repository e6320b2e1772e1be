"""Frames of the robot link (docs/link.md) in plain Python: the second implementation, made from the document.

A frame is ':' + upper-case hexadecimal + line feed. Header, payload, CRC-16, MAC; numbers are big-endian.
"""

import struct

VERSION = 1
COMMAND, TELEMETRY, GROUP, HEALTH, COUNTERS, TARGET, FIX = range(1, 8)
PAYLOAD_BYTES = {COMMAND: 11, TELEMETRY: 47, HEALTH: 27, COUNTERS: 48, TARGET: 18, FIX: 16}
COUNTER_NAMES = (
    "accepted fixes malformed unknown crc mac reserved not_for_this_robot old_epoch out_of_order clock_unknown stale"
).split()
STATUS_NAMES = "running ramping latched clock_known stopped saturated".split()
HEALTH_FLAGS = "anchored bounded stalled sensor_fault".split()
MASK = 0xFFFFFFFFFFFFFFFF


class FrameError(Exception):
    """What is wrong with received bytes; `reason` is the counter that it belongs to."""

    def __init__(self, reason, text):
        super().__init__(text)
        self.reason = reason


def crc16(data):
    """CRC-16/CCITT-FALSE: 0x1021, start 0xFFFF, not reflected."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021) if crc & 0x8000 else crc << 1
            crc &= 0xFFFF
    return crc


def siphash24(key, data):
    """SipHash-2-4 (Aumasson, Bernstein 2012) as a 64-bit number."""

    def rotate(value, by):
        return (value << by | value >> (64 - by)) & MASK

    k0, k1 = struct.unpack("<QQ", key)
    v0, v1 = k0 ^ 0x736F6D6570736575, k1 ^ 0x646F72616E646F6D
    v2, v3 = k0 ^ 0x6C7967656E657261, k1 ^ 0x7465646279746573

    def rounds(count, v0, v1, v2, v3):
        for _ in range(count):
            v0 = (v0 + v1) & MASK
            v1 = rotate(v1, 13) ^ v0
            v0 = rotate(v0, 32)
            v2 = (v2 + v3) & MASK
            v3 = rotate(v3, 16) ^ v2
            v0 = (v0 + v3) & MASK
            v3 = rotate(v3, 21) ^ v0
            v2 = (v2 + v1) & MASK
            v1 = rotate(v1, 17) ^ v2
            v2 = rotate(v2, 32)
        return v0, v1, v2, v3

    whole = len(data) // 8 * 8
    words = [struct.unpack_from("<Q", data, at)[0] for at in range(0, whole, 8)]
    words.append(int.from_bytes(data[whole:], "little") | (len(data) & 0xFF) << 56)
    for word in words:
        v3 ^= word
        v0, v1, v2, v3 = rounds(2, v0, v1, v2, v3)
        v0 ^= word
    v2 ^= 0xFF
    v0, v1, v2, v3 = rounds(4, v0, v1, v2, v3)
    return v0 ^ v1 ^ v2 ^ v3


def mac(key, data):
    """First four bytes of the hash, little-endian."""
    return siphash24(key, data).to_bytes(8, "little")[:4]


def scaled(value, unit, low, high):
    """Nearest multiple of the unit, half away from zero, within the field's limits; 0 for what is no number."""
    if value != value:
        return 0
    steps = value / unit
    if steps in (float("inf"), float("-inf")):
        return high if steps > 0 else low
    nearest = int(abs(steps) + 0.5) * (1 if steps >= 0 else -1)
    return max(low, min(high, nearest))


def i16(value, unit):
    return struct.pack(">h", scaled(value, unit, -0x8000, 0x7FFF))


def u16(value, unit):
    return struct.pack(">H", scaled(value, unit, 0, 0xFFFF))


def i32(value, unit):
    return struct.pack(">i", scaled(value, unit, -0x80000000, 0x7FFFFFFF))


def u8(value, unit):
    return bytes([scaled(value, unit, 0, 0xFF)])


def wrap(data):
    return b":" + data.hex().upper().encode() + b"\n"


def header(kind, h):
    clock_ms = h.get("clock_ms", 0) or 1
    return struct.pack(
        ">BBBIIIII", VERSION, kind, h["robot"], h["epoch"], h["sequence"], h["tick"], clock_ms, h.get("echo_ms", 0)
    )


def sealed(key, data):
    data += struct.pack(">H", crc16(data))
    return wrap(data + mac(key, data))


def bits(names, values):
    return sum(1 << at for at, name in enumerate(names) if values.get(name))


def command_payload(c):
    flags = bits(["enable", "stop", "clear"], c)
    wheels = list(c.get("wheel_rad_per_s", [])) + [0.0] * 4
    return bytes([flags]) + b"".join(i16(w, 0.01) for w in wheels[:4]) + i16(c.get("steering_rad", 0.0), 0.0001)


def encode_command(h, c, key):
    return sealed(key, header(COMMAND, h) + command_payload(c))


def encode_group(h, parts, key_of):
    """`parts`: (robot, echo_ms, command) in ascending order of robots."""
    shared = struct.pack(
        ">BBBIIII", VERSION, GROUP, len(parts), h["epoch"], h["sequence"], h["tick"], h.get("clock_ms", 0) or 1
    )
    data = shared
    for robot, echo_ms, command in parts:
        own = struct.pack(">BI", robot, echo_ms) + command_payload(command)
        data += own + mac(key_of(robot), shared + own)
    return wrap(data + struct.pack(">H", crc16(data)))


def encode_telemetry(h, t, key):
    data = header(TELEMETRY, h) + bytes([bits(STATUS_NAMES, t["status"])]) + struct.pack(">I", t["applied_sequence"])
    data += b"".join(i16(w, 0.01) for w in t["wheel_rad_per_s"])
    data += b"".join(i32(w, 0.001) for w in t["wheel_rad"])
    data += b"".join(i16(c, 0.01) for c in t["current_a"])
    data += u16(t["bus_v"], 0.001) + i16(t["gyro_z_rad_per_s"], 0.001)
    data += b"".join(i16(a, 0.01) for a in t["accel_m_per_s2"]) + i16(t["steering_rad"], 0.0001)
    return sealed(key, data)


def encode_health(h, t, key):
    data = header(HEALTH, h) + bytes([bits(STATUS_NAMES, t["status"]), t["battery"], bits(HEALTH_FLAGS, t)])
    data += i32(t["x_m"], 0.0001) + i32(t["y_m"], 0.0001) + i16(t["yaw_rad"], 0.0001)
    data += i16(t["forward_m_per_s"], 0.001) + i16(t["left_m_per_s"], 0.001) + i16(t["yaw_rate_rad_per_s"], 0.001)
    data += u16(t["position_sd_m"], 0.0001) + u16(t["yaw_sd_rad"], 0.0001)
    data += i16(t["gyro_bias_rad_per_s"], 0.00001) + u16(t["rest_v"], 0.001)
    return sealed(key, data)


def encode_counters(h, counters, key):
    return sealed(key, header(COUNTERS, h) + struct.pack(">12I", *(counters.get(name, 0) for name in COUNTER_NAMES)))


def encode_target(h, t, key):
    """`aim`: ("twist", forward, left, yaw rate) or ("pose", x, y, yaw). Caps and region are meant to stand on their grid."""
    kind, *aim = t["aim"]
    flags = bits(["enable", "stop", "clear"], t) | (8 if kind == "pose" else 0)
    data = header(TARGET, h) + bytes([flags, min(t["expiry_ms"], 100)])
    units = (0.001, 0.001, 0.0001) if kind == "pose" else (0.001, 0.001, 0.001)
    data += b"".join(i16(value, unit) for value, unit in zip(aim, units))
    data += u8(t["speed_cap_m_per_s"], 0.02) + u8(t["yaw_rate_cap_rad_per_s"], 0.05)
    return sealed(key, data + b"".join(i16(side, 0.001) for side in t["region"]))


def encode_fix(h, f, key):
    data = header(FIX, h) + i32(f["x_m"], 0.0001) + i32(f["y_m"], 0.0001) + i16(f["yaw_rad"], 0.0001)
    data += struct.pack(">I", f["exposure_ms"])
    return sealed(key, data + u8(f["position_sd_m"], 0.0005) + u8(f["yaw_sd_rad"], 0.001))


def unwrap(characters):
    """Length, enclosure and digits."""
    if len(characters) < 2:
        raise FrameError("malformed", f"{len(characters)} characters")
    if characters[:1] != b":":
        raise FrameError("malformed", "does not begin with ':'")
    if characters[-1:] != b"\n":
        raise FrameError("malformed", "does not end with a line feed")
    digits = characters[1:-1]
    if len(digits) % 2 or not 29 <= len(digits) // 2 <= 341:
        raise FrameError("malformed", f"{len(characters)} characters")
    if any(digit not in b"0123456789ABCDEF" for digit in digits):
        raise FrameError("malformed", "not an upper-case hexadecimal digit")
    return bytes.fromhex(digits.decode())


def decode(characters, robot, key):
    """Reads a frame as this robot does; returns (header, kind, payload) with the payload's fields by name."""
    data = unwrap(characters)
    version, kind = data[0], data[1]
    if version != VERSION:
        raise FrameError("unknown", f"version {version}")
    if kind == GROUP:
        return decode_group(data, robot, key)
    if kind not in PAYLOAD_BYTES:
        raise FrameError("unknown", f"type {kind}")
    body, crc, found = data[:-6], data[-6:-4], data[-4:]
    if len(body) != 23 + PAYLOAD_BYTES[kind]:
        raise FrameError("malformed", f"{len(characters)} characters for type {kind}")
    if struct.pack(">H", crc16(body)) != crc:
        raise FrameError("crc", "damaged")
    if mac(key, data[:-4]) != found:
        raise FrameError("mac", "not made with this robot's key")
    _, _, number, epoch, sequence, tick, clock_ms, echo_ms = struct.unpack(">BBBIIIII", body[:23])
    h = dict(robot=number, epoch=epoch, sequence=sequence, tick=tick, clock_ms=clock_ms, echo_ms=echo_ms)
    return h, kind, READERS[kind](body[23:])


def decode_group(data, robot, key):
    count = data[2]
    if not 1 <= count <= 16 or len(data) != 21 + 20 * count:
        raise FrameError("malformed", "length of a group")
    if struct.pack(">H", crc16(data[:-2])) != data[-2:]:
        raise FrameError("crc", "damaged")
    parts = [data[at : at + 20] for at in range(19, len(data) - 2, 20)]
    numbers = [part[0] for part in parts]
    if any(a >= b for a, b in zip(numbers, numbers[1:])):
        raise FrameError("malformed", "parts out of order")
    if robot not in numbers:
        raise FrameError("not_for_this_robot", "no part for this robot")
    part = parts[numbers.index(robot)]
    if mac(key, data[:19] + part[:16]) != part[16:]:
        raise FrameError("mac", "not made with this robot's key")
    epoch, sequence, tick, clock_ms = struct.unpack(">IIII", data[3:19])
    (echo_ms,) = struct.unpack(">I", part[1:5])
    h = dict(robot=robot, epoch=epoch, sequence=sequence, tick=tick, clock_ms=clock_ms, echo_ms=echo_ms)
    return h, COMMAND, read_command(part[5:16])


def flags_of(byte, names):
    if byte >> len(names):
        raise FrameError("reserved", f"reserved bits in {byte:#04x}")
    return {name: bool(byte >> at & 1) for at, name in enumerate(names)}


def read_command(p):
    c = flags_of(p[0], ["enable", "stop", "clear"])
    *wheels, steering = struct.unpack(">5h", p[1:11])
    return c | dict(wheel_rad_per_s=[w * 0.01 for w in wheels], steering_rad=steering * 0.0001)


def read_telemetry(p):
    f = struct.unpack(">BI4h4i4hHhhhh", p)
    return dict(
        status=flags_of(f[0], STATUS_NAMES),
        applied_sequence=f[1],
        wheel_rad_per_s=[v * 0.01 for v in f[2:6]],
        wheel_rad=[v * 0.001 for v in f[6:10]],
        current_a=[v * 0.01 for v in f[10:14]],
        bus_v=f[14] * 0.001,
        gyro_z_rad_per_s=f[15] * 0.001,
        accel_m_per_s2=[v * 0.01 for v in f[16:18]],
        steering_rad=f[18] * 0.0001,
    )


def read_health(p):
    f = struct.unpack(">BBBiihhhhHHhH", p)
    if f[1] > 3:
        raise FrameError("reserved", f"battery level {f[1]}")
    units = (0.0001, 0.0001, 0.0001, 0.001, 0.001, 0.001, 0.0001, 0.0001, 0.00001, 0.001)
    names = (
        "x_m y_m yaw_rad forward_m_per_s left_m_per_s yaw_rate_rad_per_s position_sd_m yaw_sd_rad "
        "gyro_bias_rad_per_s rest_v"
    ).split()
    values = {name: value * unit for name, value, unit in zip(names, f[3:], units)}
    return dict(status=flags_of(f[0], STATUS_NAMES), battery=f[1]) | flags_of(f[2], HEALTH_FLAGS) | values


def read_counters(p):
    return dict(zip(COUNTER_NAMES, struct.unpack(">12I", p)))


def read_target(p):
    f = struct.unpack(">BB3hBB4h", p)
    t = flags_of(f[0] & ~8, ["enable", "stop", "clear"])
    if f[1] > 100:
        raise FrameError("reserved", f"expiry {f[1]} ms")
    is_pose = bool(f[0] & 8)
    aim = ("pose", f[2] * 0.001, f[3] * 0.001, f[4] * 0.0001) if is_pose else ("twist", *(v * 0.001 for v in f[2:5]))
    return t | dict(
        aim=aim,
        expiry_ms=f[1],
        speed_cap_m_per_s=f[5] * 0.02,
        yaw_rate_cap_rad_per_s=f[6] * 0.05,
        region=[v * 0.001 for v in f[7:11]],
    )


def read_fix(p):
    f = struct.unpack(">iihIBB", p)
    return dict(
        x_m=f[0] * 0.0001,
        y_m=f[1] * 0.0001,
        yaw_rad=f[2] * 0.0001,
        exposure_ms=f[3],
        position_sd_m=f[4] * 0.0005,
        yaw_sd_rad=f[5] * 0.001,
    )


READERS = {
    COMMAND: read_command,
    TELEMETRY: read_telemetry,
    HEALTH: read_health,
    COUNTERS: read_counters,
    TARGET: read_target,
    FIX: read_fix,
}
