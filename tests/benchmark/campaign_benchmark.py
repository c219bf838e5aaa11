#!/usr/bin/env python3
"""What a campaign costs beside its replays, in processor time, which other processes of the machine change little: the shortest
cases, at a thousand and a hundred thousand of them, cases of about a second, and the table of a million rows.

Usage: campaign_benchmark.py IMUD IMU_TRUTH IMU_CAMPAIGN [CASES [ROWS]]. Not a test: it takes minutes, and 6 GB of the disk. The exit
code is 1 if a goal is missed. Fewer ROWS are compared with their share of the minute.
"""
import pathlib
import resource
import subprocess
import sys
import tempfile
import time

imud, imu_truth, imu_campaign = sys.argv[1:4]
most, rows = (int(sys.argv[i]) if len(sys.argv) > i else default for i, default in ((4, 100_000), (5, 1_000_000)))
MILLION = 1_000_000

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
# A process of its own starts the command, so that its memory is that of the largest process of this command alone.
MEASURE = """import resource, subprocess, sys
done = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(used.ru_utime + used.ru_stime, used.ru_maxrss * 1024)
sys.stderr.buffer.write(done.stderr)
sys.exit(done.returncode)
"""


def run(*words):
    """Returns the processor time of a command, s, and the memory of its largest process, bytes."""
    done = subprocess.run([sys.executable, "-c", MEASURE, *map(str, words)], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"{words}: exit code {done.returncode}\n{done.stderr}")
    time_s, memory = done.stdout.split()
    return float(time_s), float(memory)


def measure(name, folder, seconds, cases, more=""):
    """Runs the campaign in one process; returns the processor time of a case, s, the memory, bytes, and the files of a million cases."""
    folder = pathlib.Path(folder) / name.replace(" ", "_")
    folder.mkdir()
    subprocess.run([imu_truth, "spiral", "--csv", folder / "truth.csv", "--for", str(seconds), "--rate", "100"],
                   check=True, capture_output=True)
    (folder / "imu.toml").write_text(IMU)
    (folder / "plan.toml").write_text(f'base = "imu.toml"\ncapture = "truth.csv"\nseeds = "1..{cases}"\n{more}')
    begin = time.monotonic()
    processor, memory = run(imud, "campaign", "run", folder / "plan.toml", "--into", folder / "runs", "--jobs", "1", "-q")
    elapsed = time.monotonic() - begin
    files = list((folder / "runs/shards").iterdir())
    size = sum(file.stat().st_size for file in files)
    print(f"{name:<28} {cases} cases of {seconds} s: {1e3 * processor / cases:.3f} ms of processor time a case, "
          f"{1e3 * elapsed / cases:.3f} ms elapsed; {len(files)} files, {size / cases:.0f} bytes a case; "
          f"largest process {memory / 1e6:.0f} MB", flush=True)
    return processor / cases, memory, len(files) * MILLION / cases


def measure_table(folder):
    """Returns the processor time in which a million rows become CSV and SQLite, s, and the ratio to that of sha256sum of the shards."""
    campaign = pathlib.Path(folder) / "rows"
    maker = pathlib.Path(__file__).parent.parent / "campaign/shard_files.py"
    subprocess.run([sys.executable, "-B", maker, campaign, str(rows), "1000"], check=True)
    size = sum(file.stat().st_size for file in (campaign / "shards").iterdir())
    digest, _ = run("sha256sum", *sorted((campaign / "shards").iterdir()))
    processor, memory = run(imu_campaign, "collect", campaign, "--csv", campaign / "t.csv", "--sqlite", campaign / "t.db")
    print(f"table                        {rows} rows, {size / 1e9:.2f} GB: {processor:.1f} s of processor time as CSV and SQLite, "
          f"{processor / digest:.1f} times as long as sha256sum of the shards; {memory / 1e6:.0f} MB", flush=True)
    return processor * MILLION / rows, processor / digest


with tempfile.TemporaryDirectory() as folder:
    shortest, little, _ = measure("shortest", folder, 0.01, 1000)
    many, much, files = measure("many", folder, 0.01, most)
    measure("shortest, integrated errors", folder, 0.01, 1000, "integrated_errors = true\n")
    longer, _, _ = measure("longer", folder, 100, 10)
    seconds = round(100 / longer)
    long, _, _ = measure("of a second", folder, seconds, 10)
    measure("of a second, integrated", folder, seconds, 10, "integrated_errors = true\n")
    table, ratio = measure_table(folder)

goals = (("a shortest case, its model's own time included, ms", 1e3 * max(shortest, many), 10),
         (f"a shortest case beside one of {long:.2f} s, %", 100 * max(shortest, many) / long, 3),
         (f"memory of {most} cases beside that of 1000", much / little, 1.1),
         ("files of a million cases", files, 10_000),
         ("a million rows as tables, s", table, 60))
print(f"\n{'measure':<54} {'result':>10} {'goal':>10}")
for name, result, goal in goals:
    print(f"{name:<54} {result:>10.4g} {goal:>10}{'' if result <= goal else '  missed'}")
sys.exit(0 if all(result <= goal for _, result, goal in goals) else 1)
