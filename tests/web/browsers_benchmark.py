"""Not a test: 8 imus at 1 kHz with two browsers that show them all, beside the same run without a browser, by turns.
usage: browsers_benchmark.py IMUD IMU_TRUTH [SECONDS [ROUNDS]]"""
import json
import math
import pathlib
import subprocess
import sys
import time

from chromium import open_browser
from imud_page import Imud

imud_path, truth_path = sys.argv[1:3]
seconds = float(sys.argv[3]) if len(sys.argv) > 3 else 600
rounds = int(sys.argv[4]) if len(sys.argv) > 4 else 1
imus = "".join(f"""
[[imu]]
name = "imu{i}"
protocol = "native"
rate_hz = 1000
port = "pty:{{folder}}/imu{i}"
gyro.max_rad_per_s = 10
accelerometer.max_m_per_s2 = 200
""" for i in range(8))


def resident_kib(pid):
    status = pathlib.Path(f"/proc/{pid}/status").read_text()
    return next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmRSS"))


def run(browser_count):
    """Returns the summary, and the resident memory once a second."""
    imud = Imud(imud_path, truth_path, imus, realtime="", arguments=("--summary", "{folder}/summary.json"))
    readers = [subprocess.Popen(["cat", f"{imud.folder.name}/imu{i}"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) for i in range(8)]
    browsers = [open_browser() for _ in range(browser_count)]
    try:
        for browser in browsers:
            browser.get(f"http://{imud.address}/")
            time.sleep(5)
            browser.execute_script("document.querySelectorAll('details').forEach((part) => (part.open = true));")
        memory_kib = []
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            time.sleep(1)
            memory_kib.append(resident_kib(imud.imud.pid))
    finally:
        for browser in browsers:
            browser.quit()
        code = imud.stop()
        for reader in readers:
            reader.kill()
            reader.wait()
    assert code == 0, "".join(imud.log)
    return json.loads(pathlib.Path(imud.folder.name, "summary.json").read_text()), memory_kib


failures = 0
missed, samples = {0: 0, 2: 0}, {0: 0, 2: 0}  # of one imu, as a hold-up concerns all
for _ in range(rounds):
    for count in (0, 2):
        summary, memory_kib = run(count)
        of = lambda key: sum(imu[key] for imu in summary["imus"])  # noqa: E731
        late = [imu["lateness_us"] for imu in summary["imus"]]
        quarter = len(memory_kib) // 4
        first, last = max(memory_kib[:quarter]), max(memory_kib[-quarter:])
        missed[count] += max(imu["missed"] for imu in summary["imus"])
        samples[count] += summary["imus"][0]["samples"]
        print(f"{count} browsers: {of('samples')} samples, {of('missed')} missed, {of('dropped')} not taken by the reader, lateness p50 "
              f"{max(p['p50'] for p in late):.0f} us, p99 {max(p['p99'] for p in late):.0f} us, memory {first} KiB in the first "
              f"quarter, {last} KiB in the last", flush=True)
        if last > 1.02 * first:
            failures += 1
            print("NOT flat memory: above 1.02 times that of the first quarter")

# Hold-ups by the machine are a Poisson process, each of which misses some 4 samples: a larger difference than this occurs once in
# 700 comparisons.
expected = missed[0] * samples[2] / samples[0]
bound = expected + 3 * math.sqrt(4 * (expected + missed[0])) + 12
print(f"missed by an imu: {missed[0]} without browsers, {missed[2]} with two, where {expected:.0f} are expected, at most {bound:.0f}")
sys.exit(failures > 0 or missed[2] > bound)
