"""A tilted turntable on a vehicle that moves over the Earth: its truth as a file, and the output of a perfect sensor on it.

imud replays the truth that is written here. The tests beside this file decode its bytes by the vendors' documents, with no code
of imud's, and compare them with the formulas of the motion: sign, axis, unit and scale to one LSB, or to a float's last digit.
"""
import math
import re
import struct
import subprocess
import sys
import tempfile
import typing
from pathlib import Path

G0 = 9.80665
DEG = math.pi / 180
RATE = 30 * DEG            # rad/s, about AXIS, which has the same components in N and B
AXIS = (1 / 3, 2 / 3, -2 / 3)
SPEED = (10.0, -4.0, 2.0)  # m/s, in N
SECONDS = 1.5
TEMPERATURE = 31.5
LATITUDE, LONGITUDE, HEIGHT = 47.0, 11.0, 600.0  # of N's origin
START = "2025-01-04T04:26:22Z"
GPS_START = 1420000000     # s

_faults = []


def check(what, got, wanted, lsb):
    """Checks numbers, or tuples of equal length, to one LSB."""
    if not isinstance(got, (tuple, list)):
        got, wanted = (got,), (wanted,)
    for i, (a, b) in enumerate(zip(got, wanted, strict=True)):
        if not abs(a - b) <= lsb:
            _faults.append(f"{what}[{i}]: {a}, not {b} (within {lsb})")


def check_floats(what, got, wanted, least=1e-3):
    """As check(), for floats: to the last digits of the largest of them, or of `least`."""
    if not isinstance(got, (tuple, list)):
        got, wanted = (got,), (wanted,)
    check(what, got, wanted, 5e-7 * max(least, *(abs(b) for b in wanted)))


def same_rotation(q):
    """Returns q or -q, whichever has a positive scalar."""
    return q if q[0] >= 0 else tuple(-x for x in q)


def finish():
    for fault in _faults[:20]:
        print(fault)
    print(f"{len(_faults)} faults")
    sys.exit(1 if _faults else 0)


# --- Linear algebra of tuples ---
def dot(a, b):
    return sum(x * y for x, y in zip(a, b, strict=True))


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def times(m, v):
    return tuple(dot(row, v) for row in m)


def transpose(m):
    return tuple(zip(*m))


def product(a, b):
    return transpose(tuple(times(a, column) for column in transpose(b)))


def scale(s, v):
    return tuple(s * x for x in v)


def dcm_from_euler(yaw, pitch, roll):
    """v_B = dcm v_N, 3-2-1."""
    (cy, sy), (cp, sp), (cr, sr) = ((math.cos(a), math.sin(a)) for a in (yaw, pitch, roll))
    return ((cp * cy, cp * sy, -sp),
            (sr * sp * cy - cr * sy, sr * sp * sy + cr * cy, sr * cp),
            (cr * sp * cy + sr * sy, cr * sp * sy - sr * cy, cr * cp))


def yaw_pitch_roll(dcm):
    return (math.atan2(dcm[0][1], dcm[0][0]), -math.asin(dcm[0][2]), math.atan2(dcm[1][2], dcm[2][2]))


def quaternion(dcm):
    """w, x, y, z of the attitude with v_B = dcm v_N: v_N = q v_B q*."""
    w = math.sqrt(1 + dcm[0][0] + dcm[1][1] + dcm[2][2]) / 2
    return (w, (dcm[1][2] - dcm[2][1]) / (4 * w), (dcm[2][0] - dcm[0][2]) / (4 * w), (dcm[0][1] - dcm[1][0]) / (4 * w))


# --- The motion ---
def turned(v, angle):
    """`v` in axes that have turned by `angle` about AXIS."""
    along = dot(AXIS, v)
    side = cross(v, AXIS)
    c, s = math.cos(angle), math.sin(angle)
    return tuple(c * x + s * y + (1 - c) * along * n for x, y, n in zip(v, side, AXIS))


AT_START = dcm_from_euler(0.7, -0.2, 0.4)
rate = scale(RATE, AXIS)
_UP = times(AT_START, (0, 0, -G0))


def dcm_BN(t):
    return transpose(tuple(turned(column, RATE * t) for column in transpose(AT_START)))


def specific_force(t):
    return turned(_UP, RATE * t)


def delta_velocity(t1, t2):
    """The integral of specific_force(): what lies along AXIS stands still, the rest turns."""
    along = scale(dot(AXIS, _UP), AXIS)
    across = tuple(u - a for u, a in zip(_UP, along))
    side = cross(_UP, AXIS)
    ds = (math.sin(RATE * t2) - math.sin(RATE * t1)) / RATE
    dc = (math.cos(RATE * t1) - math.cos(RATE * t2)) / RATE
    return tuple(a * (t2 - t1) + x * ds + y * dc for a, x, y in zip(along, across, side))


def delta_angle(t1, t2):
    return scale(t2 - t1, rate)


# --- The Earth: WGS 84, IGRF-14, the U.S. Standard Atmosphere of 1976 ---
_A, _F = 6378137.0, 1 / 298.257223563
_E2 = _F * (2 - _F)
# The magnetic field at START, nT north, east and down, at the places of t = 0 and t = 1.5 s: computed with pyIGRF 1.0.0
# (zzyztyy/pyIGRF, 89d2f50).
_FIELD_AT_0, _FIELD_AT_1_5 = (21676.648, 1497.768, 43197.843), (21676.601, 1497.764, 43197.982)


def _dcm_LE(latitude, longitude):
    (sp, cp), (sl, cl) = ((math.sin(a), math.cos(a)) for a in (latitude, longitude))
    return ((-sp * cl, -sp * sl, cp), (-sl, cl, 0), (-cp * cl, -cp * sl, -sp))


def _cartesian(latitude, longitude, height):
    n = _A / math.sqrt(1 - _E2 * math.sin(latitude) ** 2)
    return ((n + height) * math.cos(latitude) * math.cos(longitude), (n + height) * math.cos(latitude) * math.sin(longitude),
            ((1 - _E2) * n + height) * math.sin(latitude))


_LOCAL = _dcm_LE(LATITUDE * DEG, LONGITUDE * DEG)


class Place:
    """At time t: latitude, longitude (rad), height, r_E, v_L, v_E, field_L (T), pressure (Pa), dcm_LE, dcm_PL."""

    def __init__(self, t):
        origin = _cartesian(LATITUDE * DEG, LONGITUDE * DEG, HEIGHT)
        self.r_E = tuple(a + b for a, b in zip(origin, times(transpose(_LOCAL), scale(t, SPEED))))
        self.v_E = times(transpose(_LOCAL), SPEED)
        self.longitude = math.atan2(self.r_E[1], self.r_E[0])
        p = math.hypot(self.r_E[0], self.r_E[1])
        self.latitude = LATITUDE * DEG
        for _ in range(10):
            n = _A / math.sqrt(1 - _E2 * math.sin(self.latitude) ** 2)
            self.height = p / math.cos(self.latitude) - n
            self.latitude = math.atan2(self.r_E[2], p * (1 - _E2 * n / (n + self.height)))
        self.dcm_LE = _dcm_LE(self.latitude, self.longitude)
        self.v_L = times(self.dcm_LE, self.v_E)
        self.dcm_PL = product(dcm_BN(t), product(_LOCAL, transpose(self.dcm_LE)))
        self.field_L = tuple(1e-9 * (a + t / 1.5 * (b - a)) for a, b in zip(_FIELD_AT_0, _FIELD_AT_1_5))
        geopotential = 6356766 * self.height / (6356766 + self.height)
        self.pressure = 101325 * (1 - 6.5e-3 * geopotential / 288.15) ** (9.80665 * 28.9644e-3 / 8.31432 / 6.5e-3)

    def to_L(self, v_P):
        return times(transpose(self.dcm_PL), v_P)


_scratch = tempfile.TemporaryDirectory(prefix="turntable")  # until the test ends
_folder = Path(_scratch.name)


def _write_truth(path):
    def names(*quantities):
        return [f"{quantity}_{axis}" for quantity in quantities for axis in "xyz"]
    rows = [",".join(["time_ns", "sigma_BN_1", "sigma_BN_2", "sigma_BN_3", *names(
        "r_BN_N", "v_BN_N", "omega_BN_B", "omegaDot_BN_B", "nonConservativeAccelpntB_B", "TotalAccumDV_BN_B")])]
    for k in range(int(SECONDS * 1000) + 1):
        t = k / 1000
        w, *v = quaternion(dcm_BN(t))
        numbers = (*scale(1 / (1 + w), v), *scale(t, SPEED), *SPEED, *rate, 0.0, 0.0, 0.0, *specific_force(t), *scale(t, specific_force(t)))
        rows.append(",".join([str(1000000 * k), *map(repr, numbers)]))
    path.write_text("\n".join(rows) + "\n")


def replay(device, port="file"):
    """The output of a device without errors; `device`: further keys of its [[imu]], and [imu.device]; `port`: file or canfile."""
    truth, config, sent = _folder / "truth.csv", _folder / "imu.toml", _folder / "bytes"
    if not truth.exists():
        _write_truth(truth)
    config.write_text(f"""clock = "fast"
[truth]
port = "file:{truth}"
format = "csv"
[earth]
frame = "local"
latitude_deg = {LATITUDE}
longitude_deg = {LONGITUDE}
height_m = {HEIGHT}
start = {START}
[[imu]]
port = "{port}:{sent}"
temperature_c = {TEMPERATURE}
model = "ideal"
{device}
""")
    sent.unlink(missing_ok=True)
    done = subprocess.run([sys.argv[1], "run", str(config)], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(done.stderr)
    return sent.read_bytes()


class Frame(typing.NamedTuple):
    time: float  # s
    id: int
    extended: bool
    data: bytes


def frames(device):
    """The frames of a CAN device as replay() has them, read from the text of candump -L."""
    lines = replay(device, "canfile").decode().splitlines()
    if not lines:
        _faults.append("no frame was sent")
    form = re.compile(r"\((\d+\.\d{6})\) can0 ([0-9A-F]{3}|[0-9A-F]{8})#([0-9A-F]*)")
    return [Frame(float(t), int(i, 16), len(i) == 8, bytes.fromhex(data)) for t, i, data in (form.fullmatch(line).groups() for line in lines)]


class Bytes:
    """Takes numbers off the front."""

    def __init__(self, data, order):
        self.data, self.order, self.at = data, order, 0

    def take(self, form):
        numbers = struct.unpack_from(self.order + form, self.data, self.at)
        self.at += struct.calcsize(self.order + form)
        return numbers if len(numbers) > 1 else numbers[0]
