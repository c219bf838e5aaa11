#!/usr/bin/env python3
"""Figures of two builds of imud side by side: `--fast` replays, the start of a process, and memory.

usage: two_builds.py BUILD OTHER [ROUNDS]

BUILD and OTHER are build folders, with imud, imu-truth and tests/imud_benchmark in BUILD and imud in OTHER. Each round runs
both builds, one after the other, the first of them by turns; a figure is the median of the rounds, and the ratio the
median of the rounds' ratios. Not a test: it takes some four minutes for ten rounds, on a machine with nothing else to do.
"""
import json
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

if len(sys.argv) < 3:
    sys.exit(__doc__)
build, other = (pathlib.Path(folder).resolve() for folder in sys.argv[1:3])
rounds = int(sys.argv[3]) if len(sys.argv) > 3 else 10
RATES = {"stim300": 2000, "vectornav": 800}  # a product's own; elsewhere 1 kHz
RANGES = "gyro.max_rad_per_s = 100\naccelerometer.max_m_per_s2 = 1000\n"
PRODUCTS = "native", "stim300", "mip", "vectornav", "dronecan", "csv"
SHORT_S, LONG_S = 20, 320  # of the truth


# The peak of a process counts its parent's memory before exec(2): this small parent prints its own peak, too.
STARTER = """
import os, sys
_, status, used = os.wait4(os.spawnv(os.P_NOWAIT, sys.argv[1], sys.argv[1:]), 0)
own = next(line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM:"))
print(os.waitstatus_to_exitcode(status), used.ru_maxrss, own)
"""


def spend(command):
    """Runs it. Returns elapsed time and processor time, s."""
    begin = time.monotonic()
    with open(os.devnull, "w", encoding="utf-8") as null:
        run = subprocess.Popen(command, stdout=null, stderr=null)
        _, status, used = os.wait4(run.pid, 0)
    if status != 0:
        sys.exit(f"{' '.join(map(str, command))}: status {os.waitstatus_to_exitcode(status)}")
    return time.monotonic() - begin, used.ru_utime + used.ru_stime


def largest_memory(command):
    """Runs it. Returns its largest memory, MB."""
    run = subprocess.run([sys.executable, "-I", "-S", "-c", STARTER, *command], check=True, text=True,
                         stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    status, peak, starter = map(int, run.stdout.splitlines()[-1].split())
    if status != 0:
        sys.exit(f"{' '.join(map(str, command))}: status {status}")
    if peak <= starter:
        sys.exit(f"{' '.join(map(str, command))}: its memory of {peak} kB may be that of its starter, {starter} kB")
    return peak / 1024


def until_ready(imud):
    """From exec to the line that says that imud is ready, s."""
    begin = time.monotonic()
    with subprocess.Popen([imud, "run", "live.toml"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as run:
        ready = next((line for line in run.stderr if " ready" in line), None)
        took = time.monotonic() - begin
        run.terminate()
        if ready is None:
            sys.exit(f"{imud} run has not become ready")
    return took


def write_configurations():
    for product in PRODUCTS:
        port = "canfile:/dev/null" if product == "dronecan" else "file:/dev/null"
        pathlib.Path(f"{product}.toml").write_text(
            f'clock = "fast"\n[truth]\nport = "file:truth.csv"\nformat = "csv"\n[[imu]]\nprotocol = "{product}"\n'
            f'port = "{port}"\n' + ("" if product in RATES else "rate_hz = 1000\n") +
            (RANGES if product in ("native", "csv") else ""), encoding="utf-8")
    pathlib.Path("live.toml").write_text(
        '[truth]\nport = "udp:127.0.0.1:0"\n[realtime]\npriority = 0\nlock_memory = false\n[control]\nsocket = "none"\n'
        '[[imu]]\nprotocol = "stim300"\nport = "file:/dev/null"\n', encoding="utf-8")


def compare(names, measure, show):
    """`measure` is called with the imud of each build, and returns a figure for each name; `show` makes words of one."""
    figures = [], []
    for i in range(rounds):
        for which in (0, 1) if i % 2 == 0 else (1, 0):
            figures[which].append(measure((build, other)[which] / "imud"))
    for name, here, there in zip(names, zip(*figures[0]), zip(*figures[1])):
        ratio = statistics.median(a / b for a, b in zip(here, there))
        print(f"  {name:<34} {show(statistics.median(here)):>12} {show(statistics.median(there)):>12} {ratio:6.2f}", flush=True)


def per_second(product):
    """Samples per second of `--fast`, without the start: of elapsed and of processor time."""
    def measure(imud):
        short, long = (spend([imud, "replay", f"{product}.toml", f"file:{s}.csv", "--fast", "-q"])
                       for s in (SHORT_S, LONG_S))
        return [(LONG_S - SHORT_S) * RATES.get(product, 1000) / (long[which] - short[which]) for which in (0, 1)]
    return measure


def model_alone(product):
    """Samples per second of the model of that configuration alone, with its truths, in one thread of BUILD."""
    run = subprocess.run([build / "tests/imud_benchmark", "--benchmark_filter=^config_model$", "--benchmark_min_time=0.5",
                          "--benchmark_format=json"], check=True, capture_output=True, text=True,
                         env=os.environ | {"IMUD_CONFIG": f"{product}.toml", "IMUD_CAPTURE": f"file:{SHORT_S}.csv"})
    return 1e9 / json.loads(run.stdout)["benchmarks"][0]["cpu_time"]


with tempfile.TemporaryDirectory() as folder:
    os.chdir(folder)
    write_configurations()
    for s in (SHORT_S, LONG_S, 10 * LONG_S):
        spend([build / "imu-truth", "coning", "--rate", "100", "--for", str(s), "--csv", f"{s}.csv"])
    print(f"Medians of {rounds} rounds: BUILD, OTHER, ratio")
    print("Fast replay of truth at 100 Hz as CSV, M samples/s")
    for product in PRODUCTS:
        million = lambda figure: f"{figure / 1e6:.2f}"  # noqa: E731
        compare([f"{product}, of elapsed time", f"{product}, of processor time"], per_second(product), million)
        alone = statistics.median(model_alone(product) for _ in range(rounds))
        print(f"    its model alone, one thread        {million(alone):>12}", flush=True)
    print("Start, ms")
    ms = lambda figure: f"{1000 * figure:.1f}"  # noqa: E731
    compare(["imud list"], lambda imud: spend([imud, "list"])[:1], ms)
    compare(["imud check, of a stim300"], lambda imud: spend([imud, "check", "live.toml"])[:1], ms)
    compare(["from exec to ready, a stim300"], lambda imud: [until_ready(imud)], ms)
    print("Largest memory, MB")
    for s in (SHORT_S, 10 * LONG_S):
        compare([f"replay of {pathlib.Path(f'{s}.csv').stat().st_size / 1e6:.0f} MB"],
                lambda imud: [largest_memory([imud, "replay", "native.toml", f"file:{s}.csv", "--fast", "-q"])], "{:.1f}".format)
