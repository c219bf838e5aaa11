"""The bridges of tools/bridges without their simulators: stand-ins for these send through the bridges to an imud in
lockstep. usage: bridges_test.py IMUD SOURCE_DIR"""
import csv
import importlib.util
import json
import math
import pathlib
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import tomllib
import types

import numpy

imud, source = sys.argv[1], pathlib.Path(sys.argv[2])
bridges = source / "tools/bridges"
sys.path.insert(0, str(source / "tools"))
sys.dont_write_bytecode = True
folder = pathlib.Path(tempfile.mkdtemp(prefix="bridges"))
faults = []


def check(what, got, wanted, tolerance=0.0):
    got, wanted = (x if isinstance(x, (list, tuple)) else [x] for x in (got, wanted))
    if len(got) != len(wanted) or any(not abs(g - w) <= tolerance for g, w in zip(got, wanted)):
        faults.append(f"{what}: {got}, not {wanted}")


def load(path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def sensed(send, rows=None, truth=""):
    """Runs `send`, which sends truths to a port in lockstep. Returns the rows of an ideal sensor of 100 Hz.

    Waits for `rows` rows, if `send` ends without waiting for imud. `truth`: further lines of the configuration.
    """
    out = folder / "out.csv"
    out.unlink(missing_ok=True)
    config = folder / "imu.toml"
    config.write_text(f"""clock = "lockstep"
truth.port = "udp:127.0.0.1:0"
{truth}
[[imu]]
rate_hz = 100
protocol = "csv"
port = "file:{out}"
gyro.max_rad_per_s = 10
accelerometer.max_m_per_s2 = 100
""")
    program = subprocess.Popen([imud, "run", config], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    log = ""
    try:
        for line in program.stderr:
            log += line
            if ready := re.search(r" ready, .*truth\.port is udp:127\.0\.0\.1:(\d+)", line):
                break
        else:
            sys.exit(log)
        send(int(ready.group(1)))
        until = time.monotonic() + 120
        while rows and len(out.read_text().splitlines()) <= rows and time.monotonic() < until:
            time.sleep(0.01)
    finally:
        program.terminate()
        log += program.communicate(timeout=120)[1]
    if program.returncode != 0:
        sys.exit(log)
    with open(out, encoding="ascii") as text:
        return list(csv.DictReader(text))


def numbers(row, quantity):
    return [float(row[f"{quantity}_{axis}"]) for axis in "xyz"]


def basilisk():
    """The module with a message that has the names of SCStatesMsgPayload (Basilisk, SCStatesMsgPayload.h)."""
    turn, force = (0.1, -0.2, 0.3), (1.0, 2.0, -9.0)

    class SysModel:
        def __init__(self):
            self.bskLogger = types.SimpleNamespace(bskLog=lambda _level, text: faults.append(text))

    class Reader:
        def isLinked(self):
            return True

        def __call__(self):
            t = self.seconds
            angle = t * math.hypot(*turn)
            axis = [x / math.hypot(*turn) for x in turn]
            return types.SimpleNamespace(
                r_BN_N=[7e6, 0, 0], v_BN_N=[0, 7500, 0], sigma_BN=[x * math.tan(angle / 4) for x in axis],
                omega_BN_B=list(turn), omegaDot_BN_B=[0, 0, 0], nonConservativeAccelpntB_B=list(force),
                TotalAccumDV_BN_B=[0, 0, 0])

    architecture = types.ModuleType("Basilisk.architecture")
    architecture.sysModel = types.SimpleNamespace(SysModel=SysModel)
    architecture.messaging = types.SimpleNamespace(SCStatesMsgReader=Reader)
    architecture.bskLogging = types.SimpleNamespace(BSK_ERROR=3)
    sys.modules |= {"Basilisk": types.ModuleType("Basilisk"), "Basilisk.architecture": architecture}
    module = load(bridges / "basilisk/imud_truth.py")

    def send(port):
        truth = module.ImudTruth("127.0.0.1", port)
        truth.Reset(0)
        for step in range(101):
            truth.scStateInMsg.seconds = step / 100
            truth.UpdateState(step * 10_000_000)
    rows = sensed(send)
    check("Basilisk: samples", len(rows), 101)
    check("Basilisk: rate", numbers(rows[50], "gyro"), turn, 1e-9)
    check("Basilisk: force at the start", numbers(rows[0], "accel"), force, 1e-9)


def gazebo():
    """JSON as gz topic prints it. The vehicle faces east, raises its nose and turns to the left."""
    message = {"header": {"stamp": {"sec": "1", "nsec": 0}}, "entityName": "vehicle", "orientation": {"w": 1},
               "angularVelocity": {"y": -0.1, "z": 0.2}, "linearAcceleration": {"x": 0.5, "z": 9.8}}
    lines = []
    for step in range(11):
        message["header"]["stamp"] = {"sec": "1", "nsec": step * 10_000_000}
        if step == 0:
            del message["header"]["stamp"]["nsec"]  # JSON leaves out 0
        lines.append(json.dumps(message))
    script = bridges / "gazebo/gazebo_to_imud.py"

    def send(port):
        subprocess.run([sys.executable, "-B", str(script), "--lockstep", "--port", str(port)],
                       input="\n".join(lines) + "\n", text=True, check=True, stderr=subprocess.DEVNULL)
    rows = sensed(send)
    check("Gazebo: samples", len(rows), 11)
    check("Gazebo: rate", numbers(rows[0], "gyro"), (0, 0.1, -0.2), 1e-12)
    check("Gazebo: force", numbers(rows[0], "accel"), (0.5, 0, -9.8), 1e-12)
    module = load(script)
    h = math.sqrt(0.5)
    for orientation, yaw in (({"w": 1}, 90), ({"w": h, "z": h}, 0), ({"w": h, "z": -h}, 180), ({"z": 1}, -90)):
        sigma = module.sigma_of({"orientation": orientation})
        check(f"Gazebo: facing {yaw} deg", [abs(sigma[0]), abs(sigma[1])], (0, 0), 1e-12)
        check(f"Gazebo: facing {yaw} deg", abs(math.degrees(4 * math.atan(sigma[2]))) if yaw == 180 else
              math.degrees(4 * math.atan(sigma[2])), yaw, 1e-9)


def packed():
    """The datagram of struct/README.md as NumPy writes it."""
    truth = tomllib.loads((bridges / "struct/simulink.toml").read_text())["truth"]
    settings = "\n".join(f"truth.{key} = {json.dumps(truth[key])}" for key in ("format", "byte_order", "fields"))
    layout = numpy.dtype([
        ("time", "<f8"), ("q", "<f8", 4), ("rate", "<f8", 3), ("force", "<f8", 3), ("position", "<f8", 3)])
    check("struct: size", layout.itemsize, 112)

    def send(port):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
            for step in range(11):
                datagram = numpy.zeros(1, layout)
                datagram["time"] = step / 100
                datagram["q"] = (math.cos(0.1 * step / 200), 0, 0, math.sin(0.1 * step / 200))
                datagram["rate"], datagram["force"], datagram["position"] = (0, 0, 0.1), (0.5, 0, -9.8), (1, 2, -3)
                line.sendto(datagram.tobytes(), ("127.0.0.1", port))
    rows = sensed(send, 11, settings)
    check("struct: samples", len(rows), 11)
    check("struct: rate", numbers(rows[5], "gyro"), (0, 0, 0.1), 1e-9)
    check("struct: force", numbers(rows[0], "accel"), (0.5, 0, -9.8), 1e-9)


def configurations():
    found = sorted(bridges.rglob("*.toml"))
    check("configurations", len(found), 5)
    for path in found:
        done = subprocess.run([imud, "check", path], capture_output=True, text=True, check=False)
        if done.returncode != 0:
            faults.append(f"{path}: {done.stderr}")


def mavlink():
    """The tee's frames, from a stream that is cut anywhere and has other bytes in between."""
    module = load(bridges / "px4/mavlink_tee.py")
    v1 = bytes([0xFE, 3, 7, 1, 1, 115, 10, 20, 30, 1, 2])
    v2 = bytes([0xFD, 2, 0, 0, 8, 1, 1, 108, 0, 0, 5, 6, 3, 4])
    signed = bytes([0xFD, 1, 1, 0, 9, 1, 1, 2, 0, 0, 9, 3, 4]) + bytes(13)
    stream = b"\x00\x55" + v1 + v2 + b"\x01" + signed + v1
    for size in range(1, len(stream)):
        held, found = bytearray(), []
        for at in range(0, len(stream), size):
            held += stream[at:at + size]
            found += module.frames(held)
        if found != [(115, v1), (108, v2), (2, signed), (115, v1)]:
            faults.append(f"mavlink_tee.py: {found} from pieces of {size} bytes")
    stand_in = load(bridges / "px4/px4_stand_in.py")
    check("CRC-16/MCRF4XX of 123456789", stand_in.crc16(b"123456789"), 0x6F91)  # reveng's catalogue


try:
    for path in bridges.rglob("*.py"):
        compile(path.read_text(), str(path), "exec")
    basilisk()
    gazebo()
    mavlink()
    packed()
    configurations()
finally:
    shutil.rmtree(folder)
sys.exit("\n".join(faults) if faults else 0)
