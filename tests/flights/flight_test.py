"""Exchanges of ArduPlane with a unit that computes its own solution, recorded in closed loop: the truth of the flight, and what
ArduPlane sent. imud receives the same again, by the recipe of tools/examples, without a fix for 30 s and with a gyro bias of 8
deg/s for 8 s. usage: flight_test.py IMUD"""
import gzip
import hashlib
import math
import os
import pathlib
import struct
import subprocess
import sys
import tempfile
import time
import tty

HERE = pathlib.Path(__file__).parent
ROOT = HERE.parents[1]
sys.path[:0] = [str(ROOT / "tools"), str(HERE.parent / "recipes")]
from lockstep_client import LockstepClient, Truth  # noqa: E402
from recipes_test import Fault, mip_fields, mip_packets, port_of_truth, vectornav_packets  # noqa: E402

PATIENCE = 60.0  # s, for any answer
OUTAGE, BIAS = (70.0, 100.0), (120.0, 128.0)  # s, as in faults.toml
HOME = (math.radians(-35.363261), math.radians(149.165230), 584.0)
GRAVITY = 9.80665  # of the flights' simulator
SENSORS = {"vn300": "vn-100", "gq7": "3dm-gx5-25", "gx5-45": "3dm-gx5-25"}
anything = (1e9, 1e9, 181)
# The state of the product and of its receiver, VN-300: mode, fix; GQ7: filter's state, kind of fix; GX5-45; and limits of the
# errors, horizontal and vertical, m, and of the attitude, deg. By the row of truth that is nearest an attitude is off by 1 deg.
EXPECTED = {
    "aligning": (((1, 1), (1, 0), (1, 0)), anything),
    "loiter": (((2, 1), (4, 0), (2, 0)), (5, 5, 3)),
    "outage": (((2, 0), (4, 3), (2, 3)), (60, 30, 3)),
    "after it": (((2, 1), (4, 0), (2, 0)), (10, 10, 3)),
    "bias": (((2, 1), (4, 0), (2, 0)), anything),
    "recovered": (((2, 1), (4, 0), (2, 0)), (10, 10, 4)),
}
faults = []


def expect(condition, text):
    if not condition:
        faults.append(text)


# --- The recorded exchange: rows of truth, and what ArduPlane sent after them ---
def steps(name):
    """Yields (row of truth, bytes of the host after it); t s; r m; v m/s; roll, pitch, yaw rad; rate rad/s."""
    row = None
    with gzip.open(HERE / f"arduplane_{name}.txt.gz", "rt", encoding="ascii") as text:
        for line in text:
            kind, *words = line.split()
            if kind == "host":
                yield row, bytes.fromhex(words[0])
                row = None
            else:
                if row is not None:
                    yield row, b""
                row = [float(word) for word in words]
    yield row, b""


def quaternion(roll, pitch, yaw):
    cr, sr, cp, sp, cy, sy = (f(angle / 2) for angle in (roll, pitch, yaw) for f in (math.cos, math.sin))
    return (cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy)


def turned_back(q, v):
    """v_B of v_N."""
    w, x, y, z = q[0], -q[1], -q[2], -q[3]
    t = [2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])]
    return (v[0] + w * t[0] + y * t[2] - z * t[1], v[1] + w * t[1] + z * t[0] - x * t[2], v[2] + w * t[2] + x * t[1] - y * t[0])


def truth_of(row, last):
    q = quaternion(*row[7:10])
    sign = math.copysign(1, q[0])
    dv_N = (row[4], row[5], row[6] - GRAVITY * row[0])
    a_N = [(v - u) / (row[0] - last[0]) for v, u in zip(row[4:7], last[4:7])] if last else [0, 0, 0]
    return Truth(simulation_time_ns=round(row[0] * 1e9), r_BN_N=row[1:4], v_BN_N=row[4:7],
                 sigma_BN=[sign * c / (1 + sign * q[0]) for c in q[1:]], omega_BN_B=row[10:13],
                 specific_force_B=turned_back(q, (a_N[0], a_N[1], a_N[2] - GRAVITY)),
                 accumulated_dv_inertial_B=turned_back(q, dv_N))


# --- One run of imud ---
class Line:
    def __init__(self, path):
        deadline = time.monotonic() + PATIENCE
        while not os.path.islink(path) and time.monotonic() < deadline:
            time.sleep(0.02)
        self.fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        tty.setraw(self.fd)
        self.data = bytearray()

    def read(self):
        try:
            while more := os.read(self.fd, 65536):
                self.data += more
        except BlockingIOError:
            pass

    def ask(self, request):
        begin = len(self.data)
        os.write(self.fd, request)
        deadline = time.monotonic() + PATIENCE
        while b"$VN" not in self.data[begin:] and time.monotonic() < deadline:
            time.sleep(0.005)
            self.read()


def fly(imud, name):
    """Returns the rows of truth, and what the unit sent."""
    changes = ["clock=lockstep", "truth.port=udp:127.0.0.1:0", f"imu.0.model={SENSORS[name]}", "imu.0.barometer.noise_pa=2",
               "imu.0.navigation.solution=filter", "imu.0.navigation.position_m=[1,1,1.5]",
               "imu.0.navigation.velocity_noise_m_per_s=[0.03,0.03,0.05]"]
    rows = []
    with tempfile.TemporaryDirectory() as folder, open(f"{folder}/log", "w+b") as log:
        daemon = subprocess.Popen([imud, "run", str(ROOT / f"tools/examples/ardupilot-{name}.toml"), "--scenario",
                                   str(HERE / "faults.toml")] + [word for change in changes for word in ("--set", change)],
                                  cwd=folder, stdout=log, stderr=log)
        try:
            line = Line(f"{folder}/imu1")
            with LockstepClient("127.0.0.1", port_of_truth(log.name, daemon)) as client:
                for row, host in steps(name):
                    if row is not None:
                        expect(client.step(truth_of(row, rows[-1] if rows else None)).accepted, f"{name}: truth of {row[0]} s refused")
                        rows.append(row)
                    line.read()
                    if host:
                        line.ask(host)
            line.read()
        except (OSError, RuntimeError, Fault) as error:
            log.seek(0)
            sys.exit(f"{name}: {error}\n{log.read().decode(errors='replace')}")
        finally:
            daemon.terminate()
            daemon.wait()
    return rows, bytes(line.data)


# --- What the unit reports ---
class Report:
    """t s; state of the product and of its receiver; lla rad, rad, m; q_LP."""

    def __init__(self, t, state, lla, q):
        self.t, self.state, self.lla, self.q = t, state, lla, q


def vectornav_reports(data):
    for _, payload in vectornav_packets(data, [("31010006011306", 104)]):
        ns, *numbers = struct.unpack_from("<Q3f4f3fH3d3f2f", payload)
        x, y, z, w = numbers[3:7]
        status, (latitude, longitude, height) = numbers[10], numbers[11:14]
        yield Report(ns / 1e9, (status & 3, status >> 2 & 1), (math.radians(latitude), math.radians(longitude), height), (w, x, y, z))


def mip_reports(data):
    """ArduPilot takes the height from the receiver, and the attitude of a GX5 from the sensor data."""
    height, fix, first, attitude = 0.0, 3, None, None
    for name, payload in mip_packets(data):
        fields = dict(mip_fields(payload))
        if name == "80" and "0A" in fields:
            attitude = struct.unpack(">4f", fields["0A"][:16])
        elif name in ("81", "91") and "03" in fields:
            height, fix = struct.unpack_from(">d", fields["03"], 24)[0], fields["0B"][0]
        elif name == "82":
            seconds = struct.unpack_from(">d", fields["D3"])[0]
            week = struct.unpack_from(">H", fields["D3"], 8)[0]
            if week == 0:
                continue  # no GPS time yet
            first = seconds if first is None else first
            state = struct.unpack(">H", fields["10"][:2])[0]
            latitude, longitude = struct.unpack_from(">2d", fields["01"])
            q = attitude or struct.unpack(">4f", fields["03"][:16])
            yield Report(seconds - first, (state, fix), (math.radians(latitude), math.radians(longitude), height), q)


def errors(report, rows):
    """Horizontal and vertical distance from the truth, m, and the angle between attitudes, deg; by the nearer row."""
    row = rows[min(len(rows) - 1, max(0, round((report.t - rows[0][0]) * (len(rows) - 1) / (rows[-1][0] - rows[0][0]))))]
    late = report.t - row[0]
    north = (report.lla[0] - HOME[0]) * 6_358_000 - row[1] - late * row[4]
    east = (report.lla[1] - HOME[1]) * 6_385_316 * math.cos(HOME[0]) - row[2] - late * row[5]
    q = quaternion(*row[7:10])
    cosine = abs(sum(a * b for a, b in zip(q, report.q)))
    return math.hypot(north, east), report.lla[2] - HOME[2] + row[3] + late * row[6], math.degrees(2 * math.acos(min(1, cosine)))


def check(name, rows, reports):
    end = rows[-1][0]
    expect(abs(len(reports) - (50 if name == "vn300" else 25) * end) < 60, f"{name}: {len(reports)} reports")
    spans = {"aligning": (0.5, 1), "loiter": (40, OUTAGE[0]), "outage": (OUTAGE[0] + 1, OUTAGE[1]),  # a receiver reports at 2 Hz
             "after it": (OUTAGE[1] + 5, BIAS[0]), "bias": BIAS, "recovered": (150, end)}
    for span, (begin, until) in spans.items():
        found = [report for report in reports if begin <= report.t < until]
        most = [max(map(abs, column)) for column in zip(*(errors(report, rows) for report in found))]
        states = {report.state for report in found}
        print(f"{name}, {span}: {most[0]:.1f} m, {most[1]:.1f} m, {most[2]:.2f} deg, states {sorted(states)}")
        wanted, limits = EXPECTED[span]
        expect(states == {wanted[list(SENSORS).index(name)]}, f"{name}, {span}: states {states}")
        expect(all(a < b for a, b in zip(most, limits)), f"{name}, {span}: {most}, not within {limits}")
        if span == "bias":
            expect(most[2] > 20, f"{name}: a gyro's bias turns the attitude by {most[2]} deg only")
    for report in reports:
        expect(report.t < 2 or 0 not in report.lla, f"{name}: place {report.lla} at {report.t} s")


def main():
    imud = str(pathlib.Path(sys.argv[1]).resolve())
    for name in sys.argv[2:] or SENSORS:
        rows, data = fly(imud, name)
        reports = list(vectornav_reports(data) if name == "vn300" else mip_reports(data))
        check(name, rows, reports)
        again = fly(imud, name)[1]
        expect(hashlib.sha256(data).digest() == hashlib.sha256(again).digest(), f"{name}: {len(data)} and {len(again)} bytes differ")
    print("\n".join(faults[:20]))
    print(f"{len(SENSORS)} flights, {len(faults)} faults")
    sys.exit(1 if faults else 0)


if __name__ == "__main__":
    main()
