"""The loop of tools/closed_loop with its own vehicle, in lockstep: the attitude converges, twice in the same way; the
flight computer's estimate in a captured flight of JSBSim; and cases of a campaign on it. usage: closed_loop_test.py IMUD
SOURCE_DIR"""
import csv
import json
import math
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib

imud, source = sys.argv[1], pathlib.Path(sys.argv[2])
loop = source / "tools/closed_loop"
capture = source / "tests/captures/jsbsim_c172_10s.pcap"
sys.path.insert(0, str(loop))
from flight_computer import Attitude, Stim300  # noqa: E402
from rotation import angle_between, euler, from_euler  # noqa: E402

DEGREE = math.pi / 180
faults = []


def expect(what, value, limit):
    print(f"{what}: {value:.3f}, limit {limit}")
    if not value < limit:
        faults.append(what)


def rows(path):
    with open(path, encoding="ascii") as text:
        return [{name: float(value) for name, value in row.items()} for row in csv.DictReader(text)]


def attitude(row, prefix=""):
    return from_euler(*(row[prefix + name] for name in ("roll", "pitch", "yaw")))


def degrees_between(a, b):
    return angle_between(a, b) / DEGREE


def fly(folder, seconds):
    """The loop as its README.md runs it. Returns truth and estimate, a row for each sample."""
    command = [sys.executable, "-B", loop / "run_loop.py", "--imud", imud, "--clock", "lockstep", "--folder", folder,
               "--for", str(seconds)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(done.stdout + done.stderr)
    return rows(folder / "truth.csv"), rows(folder / "estimate.csv")


def check_loop(truth, estimate):
    expect("samples that are missing", abs(4501 - len(estimate)) + abs(4501 - len(truth)), 1)
    pairs = list(zip(truth, estimate))
    expect("times that differ", sum(abs(t["time_s"] - e["time_s"]) > 1e-9 for t, e in pairs), 1)
    first, last = pairs[0], pairs[-1]
    expect("25 deg of roll at the start", abs(first[0]["roll"] / DEGREE - 25), 1e-6)
    # The STIM300's errors with seed 1: a tilt by the accelerometers' noise, and what the gyros' adds up to in yaw.
    errors = [degrees_between(attitude(t), attitude(e)) for t, e in pairs if t["time_s"] >= 2]
    expect("estimate from 2 s on, deg", max(errors), 0.15)
    # The targets change at 6 and 12 s; a second-order response of 2 rad/s has settled 5 s later.
    for begin, end in ((5, 6), (11, 12), (17, 18)):
        settled = [degrees_between(attitude(t), attitude(e, "wanted_")) for t, e in pairs
                   if begin <= t["time_s"] < end]
        expect(f"attitude from {begin} to {end} s, deg", max(settled), 0.25)
    expect("rate at the end, deg/s", math.hypot(*(last[0][f"omega_{axis}"] for axis in "xyz")) / DEGREE, 0.5)


def flown_attitudes():
    """Roll, pitch and yaw (rad) in the capture, by the time since its first row, ms."""
    texts = [line.split(",") for line in capture_lines(capture)]
    columns = {name.strip(): i for i, name in enumerate(texts[0][1:])}  # the row of labels begins with <LABELS>
    rows_of_numbers = [[float(row[columns[name]]) for name in ("Time", "phi-rad", "theta-rad", "psi-rad")]
                       for row in texts[1:]]
    return {round(1e3 * (row[0] - rows_of_numbers[0][0])): row[1:] for row in rows_of_numbers}


def check_capture(folder):
    """Ten seconds of JSBSim by imud's file, no loop: the estimate follows the aircraft's attitude."""
    settings = ("truth.port=udp:127.0.0.1:5140", "truth.format=jsbsim", f"imu.0.port=file:{folder / 'bytes'}")
    command = [imud, "replay", loop / "imud.toml", capture, "--fast", *(x for s in settings for x in ("--set", s))]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(done.stderr)
    flown = flown_attitudes()
    estimate = Attitude(flown[0])
    sensor, worst, compared = Stim300(), 0.0, 0
    for seconds, rate, force in sensor.feed((folder / "bytes").read_bytes()):
        estimate.update(seconds, rate, force)
        if (at := round(1e3 * seconds)) in flown:
            roll, pitch, _ = euler(estimate.q_NB)
            worst = max(worst, abs(roll - flown[at][0]) / DEGREE, abs(pitch - flown[at][1]) / DEGREE)
            compared += 1
    expect("instants of the capture not compared", abs(501 - compared), 1)
    expect("bytes of no datagram", sensor.skipped, 1)
    # The Earth turns by 0.04 deg in 10 s, and 50 m/s around it by 0.005 deg more; the rest is noise.
    expect("roll and pitch in the capture, deg", worst, 0.15)


def check_campaign(folder):
    """Cases of estimator.toml: the attitudes in it are the capture's, no sample is lost, and noise alone is an error."""
    plan = tomllib.loads((loop / "estimator.toml").read_text())
    given = {name: [float(x) for x in re.search(rf"--{name}-deg (\S+ \S+ \S+)", plan["test"]["command"])[1].split()]
             for name in ("start", "end")}
    flown = flown_attitudes()
    for name, at in (("start", 0), ("end", 10000)):
        expect(f"{name} in the plan less that of the capture, deg",
               max(abs(a - b / DEGREE) for a, b in zip(given[name], flown[at])), 1e-5)
    noises = plan["axes"]["imu.0.gyro.angle_random_walk_deg_per_rt_hr"]
    for i in range(len(noises)):
        command = [imud, "campaign", "run", loop / "estimator.toml", "--into", folder, "--case", f"{50 * i}..{50 * i + 2}"]
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
        if done.returncode != 0:
            sys.exit(done.stdout + done.stderr)
    cases = [json.loads(line) for shard in sorted(folder.glob("**/*.jsonl")) for line in shard.read_text().splitlines()]
    metrics = [case["test"]["metrics"] for case in cases if "test" in case]
    expect("cases that are missing", abs(3 * len(noises) - len(metrics)), 1)
    expect("samples that an estimator has not had", sum(abs(2501 - one["samples"]) for one in metrics), 1)
    # Of given seeds: no chance is in it. The noise turns each axis by sqrt(2) N sqrt(t), see the README.md.
    mean = [sum(one["error_deg"] for one in metrics[3 * i:3 * i + 3]) / 3 for i in range(len(noises))]
    expect("error with the least noise, deg", mean[0], 0.2)
    expect("expected error with the most noise, less the mean of three, deg", abs(1.9 - mean[-1]), 1.3)


def check_relative(folder):
    """JSBSim by a path that is relative to the caller's folder: the simulator starts, here one that fails at once."""
    (folder / "aircraft").mkdir(parents=True)
    (folder / "jsbsim").write_text("#!/bin/sh\necho this is the simulator; exit 7\n")
    (folder / "jsbsim").chmod(0o755)
    command = [sys.executable, "-B", loop.resolve() / "run_loop.py", "--imud", pathlib.Path(imud).resolve(), "--folder",
               "flown", "--jsbsim", "./jsbsim"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, timeout=100)
    expect("exit code of the simulator that is not passed on", abs(7 - done.returncode), 1)
    expect("simulators that did not start", 0 if "this is the simulator" in done.stderr else 1, 1)
    done = subprocess.run([*command[:-1], "./none"], cwd=folder, capture_output=True, text=True, check=False, timeout=100)
    expect("programs that are missing without a word", 0 if "./none is no program" in done.stderr else 1, 1)


def capture_lines(path):
    """The text of the datagrams in a pcap: after 42 bytes of Ethernet, IPv4 and UDP."""
    data, at = path.read_bytes(), 24
    while at < len(data):
        size = int.from_bytes(data[at + 8:at + 12], "little")
        yield data[at + 16 + 42:at + 16 + size].decode("ascii").strip()
        at += 16 + size


folder = pathlib.Path(tempfile.mkdtemp(prefix="closed_loop"))
try:
    truth, estimate = fly(folder / "1", 18)
    check_loop(truth, estimate)
    expect("a second run that differs", (truth[:501], estimate[:501]) != fly(folder / "2", 2), 1)
    check_capture(folder)
    check_campaign(folder / "campaign")
    check_relative(folder / "3")
finally:
    shutil.rmtree(folder)
sys.exit(f"outside of their limits: {', '.join(faults)}" if faults else 0)
