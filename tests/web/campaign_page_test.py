"""The page of a campaign in Chromium: what it shows of a folder, while shards come, and on a phone; and its JSON.
usage: campaign_page_test.py IMUD SCREENSHOT_FOLDER"""
import json
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import urllib.error
import urllib.request

sys.path.append(str(pathlib.Path(__file__).resolve().parent.parent / "campaign"))
import shard_files  # noqa: E402
from chromium import check_in_browser, expect_no_errors, save_picture, text  # noqa: E402
from imud_page import wait_until  # noqa: E402

imud_path, pictures = sys.argv[1], pathlib.Path(sys.argv[2])
pictures.mkdir(parents=True, exist_ok=True)
CASES, BATCH, SEEDS = 400, 20, 50
WALKS = ["0.1", "0.2", "0.4", "0.8"]


def row(index):
    """With the walk 0.8 every fifth case fails; case 7 could not be run, and case 60 is incomplete."""
    walk, scenario = WALKS[index // SEEDS % 4], ["", "stuck <b>gyro</b>.toml"][index // (4 * SEEDS)]
    members = {"axes": {"imu.imu1.gyro.angle_random_walk_deg_per_rt_hr": walk, "scenario": scenario}, "seed": 1 + index % SEEDS,
               "expect": {"settles": True}}
    if index == 7:
        members |= {"exit_code": 1, "ended_by": "failure", "expect": {}, "error": "a worker process was ended by signal 9"}
    elif index == 60:
        members |= {"exit_code": 3, "shortfalls": ["no truth for 2 s"]}
    elif walk == "0.8" and index % 5 == 0:
        members |= {"exit_code": 3, "expect": {"settles": False}}
    return shard_files.row_of(index, **members)


def write_shards(folder, begin, end):
    for first in range(begin, end, BATCH):
        shard_files.write_shard(folder, [row(index) for index in range(first, first + BATCH)])


def answer(path, **headers):
    request = urllib.request.Request(address + path, headers=headers)
    return urllib.request.urlopen(request, timeout=60)


def status():
    with answer("status") as response:
        assert response.headers["Content-Type"] == "application/json", response.headers["Content-Type"]
        return json.loads(response.read())


def check_http():
    with answer("") as response:
        policy = response.headers["Content-Security-Policy"]
        assert policy.startswith("default-src 'self'; base-uri 'none'"), policy
        assert "<title>imud campaign</title>" in response.read().decode()
    for path, headers, code in ("metrics", {}, 404), ("main.js", {}, 404), ("api", {}, 404), ("status", {"Host": "evil.example"}, 421), \
            ("status", {"Origin": "http://evil.example"}, 403):
        try:
            answer(path, **headers)
            raise AssertionError(f"{path} is answered")
        except urllib.error.HTTPError as error:
            assert error.code == code, (path, error.code)
    shards, away = pathlib.Path(folder) / "shards", pathlib.Path(folder) / "away"
    shards.rename(away)
    shards.write_text("")
    try:
        answer("status")
        raise AssertionError("a status without a folder of shards")
    except urllib.error.HTTPError as error:
        assert error.code == 500 and "cannot be read: Not a directory" in error.read().decode(), error
    shards.unlink()
    away.rename(shards)
    now = status()
    # 0.8 has 20 of the 100 cases in each half; the first half and case 7 of 0.1 are there.
    assert [now[key] for key in ("cases", "cases_done", "failed", "expectations_failed", "incomplete")] == [CASES, 199, 1, 10, 1], now
    assert now["rates"][0] | {"wilson_95": 0} == {"name": "cases", "runs": 199, "passes": 188, "wilson_95": 0}, now["rates"]
    # The bounds are the roots of the score test.
    low, high = now["rates"][0]["wilson_95"]
    for bound in low, high:
        assert abs((188 / 199 - bound) ** 2 - 1.959964 ** 2 * bound * (1 - bound) / 199) < 1e-6, (low, high)
    walks = now["axes"][0]["values"]
    assert [(value["value"], value["rates"][1]["runs"], value["rates"][1]["passes"]) for value in walks] == [
        ("0.1", 49, 49), ("0.2", 50, 50), ("0.4", 50, 50), ("0.8", 50, 40)], walks
    assert [case["case"] for case in now["failed_cases"]] == [7, 60, *range(150, 200, 5)], now["failed_cases"]
    assert now["failed_cases"][0]["repeat"] == f"imud campaign repeat {folder} 7 --record case_7.pcapng", now["failed_cases"][0]
    assert (now["shards_whole"], now["shards_read"], now["shards_present"], now["left_s"]) == (10, 10, 10, None), now


def check(browser):
    browser.get(address)
    wait_until("the state", lambda: text(browser, "#state") == "199 of 400 cases are done; nothing runs.")
    assert text(browser, "#resume code") == f"imud campaign resume {folder}", text(browser, "#resume")
    assert "188 of 199\t94.47 %" in text(browser, "#rates") and "189 of 199\t94.97 %" in text(browser, "#rates"), text(browser, "#rates")
    assert "settles does not hold" in text(browser, "#failed") and "Case 7 seed 8" in text(browser, "#failed") and ", scenario none: " in text(browser, "#failed"), text(browser, "#failed")
    save_picture(browser, pictures / "campaign_wide.png", 1200, "light")
    save_picture(browser, pictures / "campaign_narrow_dark.png", 400, "dark")
    # More shards, which a process writes.
    write_shards(folder, 200, CASES - BATCH)
    shard_files.write_unfinished_shard(folder, CASES - BATCH, CASES - 1)
    wait_until("other shards", lambda: text(browser, "#state").startswith("379 of 400 cases are done; one process runs on one host"))
    assert not browser.find_element("css selector", "#resume").is_displayed()
    assert "stuck <b>gyro</b>.toml" in text(browser, "#axes"), text(browser, "#axes")
    # Case 60, of the walk 0.2, is incomplete, but the expectation holds.
    assert "99 of 100" in text(browser, "#axes"), text(browser, "#axes")
    browser.find_element("css selector", "#rate option:nth-of-type(2)").click()
    wait_until("rates of the expectation", lambda: "99 of 100" not in text(browser, "#axes"))
    assert "100 of 100" in text(browser, "#axes") and "64 of 80" in text(browser, "#axes"), text(browser, "#axes")
    write_shards(folder, CASES - BATCH, CASES)
    # A shard is replaced: case 7 was run.
    shard_files.write_shard(folder, [row(index) | ({"exit_code": 0, "error": None, "expect": {"settles": True}} if index == 7 else {})
                                     for index in range(BATCH)])
    wait_until("the end", lambda: text(browser, "#state") == "All 400 cases are done.")
    wait_until("case 7", lambda: "379 of 400" in text(browser, "#rates") and "Case 7 " not in text(browser, "#failed"))
    expect_no_errors(browser)
    save_picture(browser, pictures / "campaign_narrow.png", 400, "light")
    save_picture(browser, pictures / "campaign_dark.png", 1200, "dark")


with tempfile.TemporaryDirectory(prefix="campaign") as folder:
    shard_files.VERSION = subprocess.run([imud_path, "--version"], capture_output=True, text=True).stdout.split()[1]
    shard_files.write_campaign(folder, CASES, BATCH)
    shown = json.loads(subprocess.run([imud_path, "campaign", "status", folder, "--json"], capture_output=True, text=True).stdout)
    shard_files.BUILD = re.fullmatch(r"imud \S+ is of a build that is not stored there and build (\w+) here", shown["difference_of_imud"])[1]
    shard_files.write_campaign(folder, CASES, BATCH)
    write_shards(folder, 0, 200)
    for address, remedy in ("0.0.0.0:0", "--token-file"), ("", "give a numeric address"):
        wrong = subprocess.run([imud_path, "campaign", "status", folder, "--web", address], capture_output=True, text=True, timeout=120)
        assert wrong.returncode != 0 and remedy in wrong.stderr, wrong
    imud = subprocess.Popen([imud_path, "campaign", "status", folder, "--web", "127.0.0.1:0"], stdout=subprocess.PIPE, text=True)
    try:
        address = imud.stdout.readline().split()[0]
        check_http()
        check_in_browser(check, pictures / "campaign_failed.png")
    finally:
        imud.send_signal(signal.SIGINT)
        assert imud.wait(timeout=120) == 0, imud.returncode
