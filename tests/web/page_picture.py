"""Not a test: the picture of README.md, of a run in which no sample was late by a period. usage: page_picture.py IMUD IMU_TRUTH FILE.png"""
import base64
import json
import pathlib
import subprocess
import sys
import urllib.request

from chromium import expect_no_errors, open_browser, text
from imud_page import Imud, wait_until

imud_path, truth_path, file = sys.argv[1:4]
before_s, fault_s, after_s = 12, 4, 6
imus = "".join(f"""
[[imu]]
name = "{name}"
protocol = "native"
model = "stim300"
rate_hz = 200
port = "{port}"
""" for name, port in (("imu1", "pty:{folder}/imu1"), ("tail", "file:{folder}/tail.bin")))


def call(method, **params):
    request = urllib.request.Request(f"http://{imud.address}/api", headers={"Content-Type": "application/json"},
                                     data=json.dumps({"jsonrpc": "2.0", "id": 1, "method": method, "params": params}).encode())
    with urllib.request.urlopen(request) as answer:
        return json.loads(answer.read())["result"]


def wait_for(seconds):
    """Waits for so many seconds of samples."""
    begin = call("status")["counters"]["duration_s"]
    wait_until(f"{seconds} s", lambda: call("status")["counters"]["duration_s"] > begin + seconds)


imud = Imud(imud_path, truth_path, imus, realtime="")
reader = subprocess.Popen(["cat", f"{imud.folder.name}/imu1"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
try:
    browser = open_browser()
    try:
        browser.get(f"http://{imud.address}/")
        wait_until("samples", lambda: browser.execute_script("return !!document.querySelector('.values td')"))
        wait_for(before_s)
        call("fault.begin", imu="imu1", target="gyro.x", kind="bias", value=0.5, for_s=fault_s)
        wait_for(fault_s + after_s)
        expect_no_errors(browser)
        # A picture beyond the window would resize the plots while it is taken.
        height = browser.execute_script("return document.documentElement.scrollHeight")
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {"width": 1280, "height": height + 100, "deviceScaleFactor": 1, "mobile": False})
        wait_for(1)
        area = browser.execute_script("""const end = document.querySelector('[aria-labelledby=log-title]').getBoundingClientRect().bottom;
            return {x: 0, y: 0, width: innerWidth, height: Math.floor(end) + 5, scale: 1};""")
        picture = browser.execute_cdp_cmd("Page.captureScreenshot", {"clip": area})
        print(text(browser, "[data-imu=imu1] .figures"))
        missed = {imu["name"]: imu["missed"] for imu in call("status")["counters"]["imus"]}
    finally:
        browser.quit()
finally:
    imud.stop()
    reader.kill()
    reader.wait()
if any(missed.values()):
    sys.exit(f"the machine is not quiet: missed {missed}")
pathlib.Path(file).write_bytes(base64.b64decode(picture["data"]))
