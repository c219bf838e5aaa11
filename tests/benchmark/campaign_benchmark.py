#!/usr/bin/env python3
"""What a case of a campaign costs beside its replay: the shortest cases, at a thousand and a hundred thousand of them,
and cases of about a second.

Usage: campaign_benchmark.py IMUD IMU_TRUTH [CASES]. Not a test: it takes minutes.
"""
import pathlib
import resource
import subprocess
import sys
import tempfile
import time

imud, imu_truth = sys.argv[1:3]
most = int(sys.argv[3]) if len(sys.argv) > 3 else 100_000

IMU = """[truth]
port = "file:none.csv"
format = "csv"
[[imu]]
name = "imu1"
rate_hz = 1000
protocol = "native"
port = "file:/dev/null"
gyro.max_rad_per_s = 100
accelerometer.max_m_per_s2 = 1000
gyro.angle_random_walk_deg_per_rt_hr = 0.1
accelerometer.velocity_random_walk_m_per_s_per_rt_hr = 0.1
"""


def measure(name, folder, seconds, cases, more=""):
    """Runs the campaign in one process; returns the processor time of a case, s."""
    folder = pathlib.Path(folder) / name.replace(" ", "_")
    folder.mkdir()
    subprocess.run([imu_truth, "spiral", "--csv", folder / "truth.csv", "--for", str(seconds), "--rate", "100"],
                   check=True, capture_output=True)
    (folder / "imu.toml").write_text(IMU)
    (folder / "plan.toml").write_text(f'base = "imu.toml"\ncapture = "truth.csv"\nseeds = "1..{cases}"\n{more}')
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    subprocess.run([imud, "campaign", "run", folder / "plan.toml", "--into", folder / "runs", "--jobs", "1", "-q"],
                   check=True, capture_output=True)
    elapsed, after = time.monotonic() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    files = list((folder / "runs/shards").iterdir())
    size = sum(file.stat().st_size for file in files)
    print(f"{name:<28} {cases} cases of {seconds} s: {1e3 * processor / cases:.3f} ms of processor time a case, "
          f"{1e3 * elapsed / cases:.3f} ms elapsed; {len(files)} files, {size / cases:.0f} bytes a case; "
          f"largest process so far {after.ru_maxrss / 1024:.0f} MB", flush=True)
    return processor / cases


with tempfile.TemporaryDirectory() as folder:
    shortest = measure("shortest", folder, 0.01, 1000)
    measure("many", folder, 0.01, most)
    measure("shortest, integrated errors", folder, 0.01, 1000, "integrated_errors = true\n")
    longer = measure("longer", folder, 100, 10)
    seconds = round(100 / longer)
    long = measure("of a second", folder, seconds, 10)
    measure("of a second, integrated", folder, seconds, 10, "integrated_errors = true\n")
    print(f"a case costs {1e3 * shortest:.2f} ms whatever its length, {100 * shortest / long:.2f} % of a case of {long:.2f} s")
