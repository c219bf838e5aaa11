#!/usr/bin/env python3
"""A thousand seeds of a ten-second flight at 1 kHz, beside what the sensor model alone takes: with every error of the
sensor model, and with those of the memorandum.

Usage: seeds_benchmark.py IMUD IMUD_BENCHMARK [SEEDS]. Not a test: it takes two minutes and 1.3 GB in TMPDIR.
"""
import json
import os
import pathlib
import resource
import subprocess
import sys
import tempfile
import time

SOURCE = pathlib.Path(__file__).resolve().parents[2]
FLIGHT = f"{SOURCE}/tests/captures/jsbsim_c172_10s.pcap?port=5140"
imud, benchmark = sys.argv[1:3]
seeds = int(sys.argv[3]) if len(sys.argv) > 3 else 1000
cores = len(os.sched_getaffinity(0))


def ns_per_step(config):
    """The model of the configuration, while all cores run it: processor time, and elapsed time."""
    command = [benchmark, "--benchmark_filter=^config_model$", "--benchmark_min_time=2", "--benchmark_format=json"]
    environment = os.environ | {"IMUD_CONFIG": str(config), "IMUD_CAPTURE": f"pcap:{FLIGHT}"}
    runs = [subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
            for _ in range(cores)]
    results = [json.loads(run.communicate()[0])["benchmarks"][0] for run in runs]
    return sum(r["cpu_time"] for r in results) / cores, sum(r["real_time"] for r in results) / cores


def measure(name, arguments, steps, cpu_ns):
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    subprocess.run([imud, "replay", *map(str, arguments), "-q"], check=True, capture_output=True)
    elapsed, after = time.monotonic() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    user, system = after.ru_utime - before.ru_utime, after.ru_stime - before.ru_stime
    model = steps * cpu_ns * 1e-9 / cores
    print(f"  {name:<10} {elapsed:.2f} s, {100 * (user + system) / elapsed / cores:.0f} % of {cores} cores busy; a step: "
          f"user {1e9 * user / steps:.0f} ns, system {1e9 * system / steps:.0f} ns; elapsed {elapsed / model:.2f}, "
          f"processor {(user + system) / cores / model:.2f} times the model's")


def compare(name, config, folder):
    cpu_ns, real_ns = ns_per_step(config)
    print(f"{name}: the model takes {cpu_ns:.0f} ns of processor time a step, {real_ns:.0f} ns elapsed "
          f"(on {cores} cores at once)")
    steps = seeds * 10001
    arguments = config, FLIGHT, "--seeds", f"1..{seeds}"
    measure("one array", [*arguments, "--npy", f"{folder}/runs.npy"], steps, cpu_ns)
    for path in pathlib.Path(folder).glob("*.npy"):
        path.unlink()
    measure("files", [*arguments, f"--set=imu.0.port=file:{folder}/{{seed}}.native"], steps, cpu_ns)
    for path in pathlib.Path(folder).glob("*.native"):
        path.unlink()


with tempfile.TemporaryDirectory() as folder:
    compare("every error", SOURCE / "tests/benchmark/every_error.toml", folder)
    text = (SOURCE / "tests/regression/jsbsim_c172_10s.toml").read_text()
    config = pathlib.Path(folder) / "memorandum.toml"
    config.write_text(text[:text.rindex("[[imu]]")].replace("rate_hz  = 200", "rate_hz  = 1000"))
    compare("the memorandum's errors", config, folder)
