"""The page of a rack in Chromium: what it shows of hosts, one of which is lost and comes back, also on a phone.
usage: rack_page_test.py IMUD SCREENSHOT_FOLDER

The ssh of this test answers with what is in a file for the host, in place of the commands that it is given."""
import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import urllib.request

from chromium import check_in_browser, expect_no_errors, save_picture, text  # noqa: E402
from imud_page import wait_until  # noqa: E402

imud_path, pictures = sys.argv[1], pathlib.Path(sys.argv[2])
pictures.mkdir(parents=True, exist_ok=True)

SSH = """#!/bin/sh
for word; do host=$before; before=$word; done
cat > /dev/null
[ -f "{folder}/$host.txt" ] || {{ echo "ssh: Could not resolve hostname $host" >&2; exit 255; }}
cat "{folder}/$host.txt"
"""


def run_of(name, first_k, **clock):
    imu = {"name": name, "protocol": "stim300", "rate_hz": 2000, "port": "serial:/dev/ttyUSB0"}
    figures = {"name": name, "samples": 400000, "dropped": 0, "missed": 3, "lateness_us": {"p99": 61.5, "max": 180}, "first_k": first_k}
    return {"name": name, "state": "running", "version": "1.2", "started": "2026-11-28 07:00:00", "imus": [imu], "faults": [],
            "counters": {"duration_s": 200.0, "truth": {"rate_hz": 100.0}, "imus": [figures],
                         "clock": {"epoch": "tai", "steps": 0, "synchronised": True, "error_us": 12, "tai_offset_s": 37} | clock}}


def answer(host, *runs, version="1.2"):
    """Writes what the host answers from now on."""
    written = folder / f"{host}.new"
    written.write_text(f"imud-rack version\nimud {version}\nimud-rack units\nactive\ninactive\nimud-rack runs\n{json.dumps({'runs': runs})}\nimud-rack end\n")
    written.rename(folder / f"{host}.txt")


def check(browser):
    browser.get(address)
    wait_until("the state", lambda: text(browser, "#state") == "2 of 4 runs are running.")
    hosts = text(browser, "#hosts")
    assert "imud@tail does not run" in hosts and "bench2 (root@bench2)" in hosts, hosts
    assert "clock tai, error 12 us" in hosts and "400,000" in hosts and "truth 100.0 Hz" in hosts, hosts
    assert "not reached: ssh: Could not resolve hostname bench3" in hosts, hosts
    remarks = text(browser, "#remarks")
    assert "versions differ: 1.2 (bench1), 1.3 (bench2)" in remarks and "bench2: wing runs version 1.2, and 1.3 is installed" in remarks, remarks
    assert "wing of imud@wing on bench2 has begun 4 s after nose of imud@nose on bench1" in remarks, remarks
    save_picture(browser, pictures / "rack_wide.png", 1200, "light")
    save_picture(browser, pictures / "rack_narrow_dark.png", 400, "dark")
    # All run, with one version and one begin.
    first_k = 2000 * 1_800_000_000
    answer("bench1", run_of("nose", first_k), run_of("tail", first_k))
    answer("root@bench2", run_of("wing", first_k))
    answer("bench3", run_of("<b>other</b>", first_k), run_of("fin", first_k))
    wait_until("all", lambda: text(browser, "#state") == "All 4 runs on 3 hosts are running.")
    assert text(browser, "#remarks") == "", text(browser, "#remarks")
    save_picture(browser, pictures / "rack_narrow.png", 400, "light")
    save_picture(browser, pictures / "rack_dark.png", 1200, "dark")
    (folder / "root@bench2.txt").unlink()
    wait_until("a lost host", lambda: text(browser, "#state") == "3 of 4 runs are running.")
    assert "Could not resolve hostname root@bench2" in text(browser, "#hosts"), text(browser, "#hosts")
    expect_no_errors(browser)


with tempfile.TemporaryDirectory(prefix="rack") as name:
    folder = pathlib.Path(name)
    (folder / "bin").mkdir()
    (folder / "bin/ssh").write_text(SSH.format(folder=name))
    (folder / "bin/ssh").chmod(0o755)
    (folder / "rack.toml").write_text('[[host]]\nname = "bench1"\nruns = ["nose.toml", "tail.toml"]\n[[host]]\nname = "bench2"\n'
                                      'ssh = "root@bench2"\nruns = ["wing.toml"]\n[[host]]\nname = "bench3"\nruns = ["fin.toml"]\n')
    answer("bench1", run_of("nose", 2000 * 1_800_000_000))
    answer("root@bench2", run_of("wing", 2000 * 1_800_000_004), version="1.3")
    environment = {**os.environ, "PATH": f"{name}/bin:{os.environ['PATH']}"}
    imud = subprocess.Popen([imud_path, "rack", "status", str(folder / "rack.toml"), "--web", "127.0.0.1:0"], stdout=subprocess.PIPE, text=True, env=environment)
    try:
        address = imud.stdout.readline().split()[0]
        with urllib.request.urlopen(address, timeout=60) as response:
            assert "<title>imud rack</title>" in response.read().decode()
        check_in_browser(check, pictures / "rack_failed.png")
    finally:
        imud.send_signal(signal.SIGINT)
        assert imud.wait(timeout=120) == 0, imud.returncode
