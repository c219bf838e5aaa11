"""What the plots of the page can do: freeze, zoom, be saved, show other units and quantities, mark times without truth, leave
gaps where there are no samples or nothing is sent, and show all imus together. usage: plots_test.py IMUD IMU_TRUTH SCREENSHOT_FOLDER"""
import base64
import csv
import json
import math
import pathlib
import re
import signal
import socket
import sys
import tempfile
import urllib.request

from chromium import check_in_browser, expect_no_errors, text
from imud_page import TWO_IMUS, Imud, wait_until
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.actions.wheel_input import ScrollOrigin
from selenium.webdriver.common.by import By

pictures = pathlib.Path(sys.argv[3])
pictures.mkdir(parents=True, exist_ok=True)
IMU1 = "[data-imu=imu1]"
FILTER = """
[imu.navigation]
solution = "filter"
"""  # of the second imu

# Returns what the shown plots of a part of the page show, by their titles, all of one moment.
PLOTS = """const part = document.querySelector(arguments[0]);
return Object.fromEntries([...(part?.querySelectorAll("figure") ?? [])].filter((figure) => !figure.hidden).map((figure) => {
  const chart = Chart.getChart(figure.querySelector("canvas")), {x} = chart.scales;
  return [figure.querySelector("figcaption").textContent, {begin_s: x.min, end_s: x.max, axis: x.options.title.text,
    ticks: x.ticks.map(({value, label}) => [value, label]),
    rows: (chart.$rows ?? []).map(({name, marks, spans}) => ({name, marks: marks.map(({mark}) => mark), spans: spans.map((span) => span.name)})),
    curves: Object.fromEntries(chart.data.datasets.map(({label, data}) => [label, data.map((p) => [p.x, p.y])])),
    shaded: chart.config.options.plugins.spans?.shaded?.() ?? []}];
}));"""
# Returns how many samples of imu1 the counters have.
SAMPLES = """const rows = [...document.querySelectorAll("#counters tr")].map((tr) => [...tr.cells].map((cell) => cell.textContent));
return Number(rows.find(([name]) => name === "samples")?.[rows[0].indexOf("imu1")] ?? 0);"""


def plots(browser, part=IMU1):
    return browser.execute_script(PLOTS, part)


def plot(browser, title, part=IMU1):
    """The plot whose title begins so; None if it is not shown."""
    return next((one for name, one in plots(browser, part).items() if name.startswith(title)), None)


def press(browser, selector):
    browser.execute_script("document.querySelector(arguments[0]).click()", selector)


def wait_for_samples(browser):
    """Waits until the page has shown a second's samples more."""
    before = browser.execute_script(SAMPLES)
    wait_until("a second's samples", lambda: browser.execute_script(SAMPLES) > before + 2000)


def call(method, **params):
    request = urllib.request.Request(f"http://{imud.address}/api", headers={"Content-Type": "application/json"},
                                     data=json.dumps({"jsonrpc": "2.0", "id": 1, "method": method, "params": params}).encode())
    with urllib.request.urlopen(request) as answer:
        return json.loads(answer.read())["result"]


def canvas_of(browser, number=0):
    canvas = browser.find_elements(By.CSS_SELECTOR, f"{IMU1} canvas")[number]
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", canvas)
    return canvas


def check_axes(browser):
    """Axes name their clock, begin with it, and have ticks at equal steps, each with its label."""
    for title, one in plots(browser).items():
        if "Lateness" in title:
            continue
        assert one["axis"] == "clock of imu1, s", (title, one["axis"])
        assert one["begin_s"] >= 0, (title, one["begin_s"])
        steps = {round(b - a, 6) for (a, _), (b, _) in zip(one["ticks"], one["ticks"][1:])}
        assert len(one["ticks"]) >= 2 and len(steps) == 1, (title, one["ticks"])
        assert all(abs(float(label) - value) < 1e-6 for value, label in one["ticks"]), (title, one["ticks"])
    legend = browser.execute_script("""const chart = Chart.getChart(document.querySelector("[data-imu=imu1] canvas"));
        return [chart.legend.options.labels.usePointStyle, chart.legend.legendItems.map(({text, pointStyle, lineDash}) => [text, pointStyle, lineDash.length > 0])];""")
    assert legend == [True, [[f"{axis}{of}", "line", of != ""] for of in ("", " truth") for axis in "xyz"]], legend
    classes = browser.execute_script("""const figure = [...document.querySelectorAll("[data-imu=imu1] figure")].at(-1);
        const chart = Chart.getChart(figure.querySelector("canvas"));
        return [figure.textContent, chart.data.labels, chart.data.datasets[0].data, chart.scales.x.ticks.length];""")
    assert classes[0] == "Lateness of imu1: share of the samples in each class, %", classes
    assert all(re.fullmatch(r"([\d.]+–|< |> )[\d.]+ (µs|ms|s)", label) for label in classes[1]), classes
    assert abs(sum(classes[2]) - 100) < 1e-6 and classes[3] == len(classes[1]), classes


def check_freeze(browser):
    """Frozen plots and figures stay as they are, and go on by one press."""
    wait_for_samples(browser)
    press(browser, "#freeze")
    before, figures = plots(browser), text(browser, f"{IMU1} .values")
    assert before and all(len(points) > 10 for title, one in before.items() if "Lateness" not in title for points in one["curves"].values())
    wait_for_samples(browser)
    after = plots(browser)
    for title, one in before.items():
        assert "Lateness" in title or after[title] == one, f"{title} goes on"
    assert text(browser, f"{IMU1} .values") == figures
    assert text(browser, "#freeze") == "Live again" and "frozen" in text(browser, "#shown-time")
    press(browser, "#freeze")
    end_s = before["Rate of imu1, rad/s: measured, and truth dashed"]["end_s"]
    wait_until("live again", lambda: plot(browser, "Rate of")["end_s"] > end_s)
    assert text(browser, "#freeze") == "Freeze plots"


def length_s(browser):
    shown = plot(browser, "Rate of")
    return shown["end_s"] - shown["begin_s"]


def check_zoom(browser):
    wait_until("a whole window of the clock", lambda: abs(length_s(browser) - 20) < 1e-6)
    canvas = canvas_of(browser)
    box = browser.execute_script("""const {chartArea, height} = Chart.getChart(arguments[0]);
        return [chartArea.left, chartArea.right, height];""", canvas)
    middle_x, middle_y = canvas.size["width"] / 2, canvas.size["height"] / 2
    scrolled = browser.execute_script("return scrollY")
    on_axis = ScrollOrigin.from_element(canvas, 0, int(box[2] - 8 - middle_y))
    ActionChains(browser).scroll_from_origin(on_axis, 0, -300).perform()
    wait_until("the wheel has zoomed in", lambda: length_s(browser) < 19)
    assert browser.execute_script("return scrollY") == scrolled, "the page has scrolled"
    assert text(browser, "#freeze") == "Freeze plots", "still live"
    ActionChains(browser).double_click(canvas).perform()
    wait_until("the whole again", lambda: abs(length_s(browser) - 20) < 1e-6)
    # From a half to three quarters of the time axis.
    width = box[1] - box[0]
    ActionChains(browser).move_to_element_with_offset(canvas, int(box[0] + width / 2 - middle_x), 0).click_and_hold().move_by_offset(
        int(width / 4), 0).release().perform()
    wait_until("the drag has zoomed in", lambda: abs(length_s(browser) - 5) < 0.2)
    assert text(browser, "#freeze") == "Live again", "a part that is not the newest is frozen"
    press(browser, "#zoom-out")
    wait_until("the button has zoomed out", lambda: abs(length_s(browser) - 10) < 0.4)
    press(browser, "#zoom-reset")
    press(browser, "#freeze")
    wait_until("the whole again", lambda: abs(length_s(browser) - 20) < 1e-6)


# Returns the size of a picture (PNG, base64), and the number of colours below the title of the first plot.
PICTURE = """const bytes = Uint8Array.from(atob(arguments[0]), (c) => c.charCodeAt(0)), done = arguments[1];
createImageBitmap(new Blob([bytes], {type: "image/png"})).then((picture) => {
  const ctx = new OffscreenCanvas(picture.width, picture.height).getContext("2d");
  ctx.drawImage(picture, 0, 0);
  done([[picture.width, picture.height], new Set(new Uint32Array(ctx.getImageData(20, 80, 300, 80).data.buffer)).size]);
}, (error) => done([[0, 0], String(error)]));"""


def downloaded(folder, name, end):
    """The content of a file that ends so, once it is complete: Chromium makes an empty file of this name first."""
    path = pathlib.Path(folder, name)
    return wait_until(f"all of {name}", lambda: path.exists() and (content := path.read_bytes()).endswith(end) and content)


def check_save(browser):
    with tempfile.TemporaryDirectory(prefix="web") as folder:
        browser.execute_cdp_cmd("Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": folder})
        wait_until("12 s of samples", lambda: (shown := plot(browser, "Rate of"))["curves"]["x"][0][0] < shown["end_s"] - 12)
        press(browser, "#freeze")
        press(browser, "#zoom-in")
        press(browser, f"{IMU1} [data-save=table]")
        header, *rows = list(csv.reader(downloaded(folder, "imud-imu1.csv", b"\n").decode().splitlines()))
        assert header[:6] == ["time_s", "sample", "truth", "sent", "rate_x_rad_per_s", "true_rate_x_rad_per_s"], header
        assert "specific_force_z_m_per_s2" in header, header
        shown = plot(browser, "Rate of")
        curve = [p for p in shown["curves"]["x"] if shown["begin_s"] <= p[0] <= shown["end_s"] and p[1] is not None]
        assert len(rows) > 20 and [[float(row[0]), float(row[4])] for row in rows] == curve, "not what the plot shows"
        press(browser, f"{IMU1} [data-save=picture]")
        picture = downloaded(folder, "imud-imu1.png", b"IEND\xaeB`\x82")
        size, colours = browser.execute_async_script(PICTURE, base64.b64encode(picture).decode())
        assert size[0] > 600 and size[1] > 300, size
        assert colours > 10, f"{colours} colours where the first plot is"
        press(browser, "#zoom-reset")
        press(browser, "#freeze")


def check_units(browser):
    press(browser, "#freeze")
    si = plots(browser)
    press(browser, "#units")
    other = plots(browser)
    for quantity, unit, in_other, factor in (("Rate", "rad/s", "deg/s", 180 / math.pi), ("Specific force", "m/s²", "g", 1 / 9.80665)):
        old, new = (one[f"{quantity} of imu1, {u}: measured, and truth dashed"]["curves"]["x"] for one, u in ((si, unit), (other, in_other)))
        assert len(old) == len(new) > 10
        assert all(a == b or abs(a[1] * factor - b[1]) < 1e-9 for a, b in zip(old, new) if a[1] is not None), quantity
    assert "Rate, deg/s" in text(browser, f"{IMU1} .values")
    browser.refresh()
    wait_until("deg/s after the page was loaded again", lambda: plot(browser, "Rate of imu1, deg/s"))
    press(browser, "#units")
    wait_until("rad/s", lambda: plot(browser, "Rate of imu1, rad/s"))


def check_quantities(browser):
    """The other quantities are shown when they are asked for; values of 45 degrees north."""
    expected = (("magnetic_field", "Magnetic field of imu1, µT", "z", 10, 70), ("pressure", "Pressure of imu1, hPa", "", 900, 1000),
                ("attitude", "Attitude of imu1, rad: as the unit reports it", "roll", -1, 1),
                ("position", "Position of imu1, m from 4", "up", -30, 30), ("temperature_c", "Temperature of imu1, °C: measured", "", 10, 60))
    for key, title, axis, low, high in expected:
        assert plot(browser, title) is None, f"{title} unasked"
        press(browser, f"#shown input[value={key}]")
        points = wait_until(title, lambda: (plot(browser, title) or {"curves": {axis: []}})["curves"][axis][-5:])
        assert all(low < y < high for _, y in points if y is not None), (title, points)
    wait_until("its figure", lambda: "Pressure, hPa, measured" in text(browser, f"{IMU1} .values"))
    browser.save_screenshot(str(pictures / "quantities.png"))
    for key, title, *_ in expected:
        press(browser, f"#shown input[value={key}]")
        wait_until(f"no {title}", lambda: plot(browser, title) is None)


def check_solution(browser):
    """A unit with a filter has its errors over the band of its standard deviations, and the aids that it uses."""
    part = '[data-imu="tail \\"left\\""]'
    keys = ("attitude_error", "velocity_error", "position_error", "normalized_square", "aids_used")
    browser.execute_script("document.querySelector(arguments[0]).open = true", part)
    wait_until("the state of the solution", lambda: "; the unit's solution: aided" in text(browser, f"{part} .values caption"))
    for key in keys:
        press(browser, f"#shown input[value={key}]")
    for name, unit in (("attitude", ", rad"), ("velocity", ", m/s"), ("position", ", m")):
        def newest(title=f'Error of {name} of tail "left"{unit}: '):
            """Of north, the newest errors in units of their standard deviations; empty while there are none."""
            curves = (plot(browser, title, part) or {"curves": {}})["curves"]
            errors, sigmas = ([(x, y) for x, y in curves.get(axis, []) if y is not None][-5:] for axis in ("north", "north, 1 σ"))
            assert not curves or set(curves) == {"north", "east", "down", "north, 1 σ", "east, 1 σ", "down, 1 σ", ""}, list(curves)
            assert [x for x, _ in errors] == [x for x, _ in sigmas] and all(y > 0 for _, y in sigmas), (errors, sigmas)
            return [abs(error) / sigma for (_, error), (_, sigma) in zip(errors, sigmas)]
        wait_until(f"an error of {name} of its size", lambda: len(ratios := newest()) == 5 and any(ratios) and max(ratios) < 8)

    def square():  # the unit may have aligned before
        return [y for _, y in plot(browser, 'Error² / σ² of tail "left": ', part)["curves"][""][-5:] if y is not None]

    wait_until("their squares", lambda: square() and all(0 < y < 60 for y in square()))
    aids = lambda name: [y for _, y in plot(browser, 'Aids of tail "left": ', part)["curves"][name] if y is not None]  # noqa: E731
    wait_until("an aid in use", lambda: 1 in aids("gnss_position"))
    assert set(aids("antennas_heading")) == {0}, aids("antennas_heading")
    assert plot(browser, "Error of attitude") is None, "imu1 has no filter"
    browser.execute_script("document.querySelector(arguments[0]).scrollIntoView()", f"{part} .plots")
    browser.save_screenshot(str(pictures / "solution.png"))
    for key in keys:
        press(browser, f"#shown input[value={key}]")
    browser.execute_script("document.querySelector(arguments[0]).open = false", part)


# Returns of the longest time, s, that is marked so, which share of the pixels is drawn upon at its middle, at the top of a plot; 0
# if no time of that length is.
COVER = """const [part, mark, least_s] = arguments, chart = Chart.getChart(document.querySelector(`${part} canvas`));
const length = ({begin_s, end_s}) => end_s - begin_s, {x} = chart.scales, scale = chart.currentDevicePixelRatio;
const [longest] = chart.config.options.plugins.spans.shaded().filter((span) => span.mark === mark).sort((a, b) => length(b) - length(a));
if (!longest || length(longest) < least_s) return 0;
const left = x.getPixelForValue((longest.begin_s + longest.end_s) / 2 - 0.1), right = x.getPixelForValue((longest.begin_s + longest.end_s) / 2 + 0.1);
const {data} = chart.ctx.getImageData(scale * left, scale * (chart.chartArea.top + 3), Math.max(2, scale * (right - left)), scale * 12);
return data.filter((value, i) => i % 4 === 3 && value > 0).length / (data.length / 4);"""


def wait_for_shade(browser, mark, least_s):
    wait_until(f"a shaded time, {mark}", lambda: browser.execute_script(COVER, IMU1, mark, least_s) > 0.95)
    browser.save_screenshot(str(pictures / f"{mark}.png"))


def check_not_sent(browser):
    """In the longest time that is marked so, the measured curve is interrupted, and the numbers are not there."""
    shown = plot(browser, "Rate of")
    span = max((s for s in shown["shaded"] if s["mark"] == "unsent"), key=lambda s: s["end_s"] - s["begin_s"])
    inside = {name: [y for x, y in curve if span["begin_s"] < x < span["end_s"]] for name, curve in shown["curves"].items()}
    assert len(inside["x"]) > 10 and all(y is None for y in inside["x"]), inside["x"]
    cells = browser.execute_script("return [...document.querySelectorAll('[data-imu=imu1] .values td')].map((cell) => cell.textContent)")
    assert cells and set(cells) <= {"–", ""}, cells
    assert "samples/s" not in text(browser, f"{IMU1} .figures"), text(browser, f"{IMU1} .figures")
    return inside


def names_above(browser):
    """The names above the first plot of imu1."""
    return [name for row in (plot(browser, "Rate of") or {"rows": []})["rows"] for name in row["spans"]]


def check_pause(browser):
    """While the output is paused the measured curve is interrupted; the truth goes on. A page that is opened meanwhile knows it."""
    wait_until("samples", lambda: re.search(r"[1-9]\d*\.\d samples/s", text(browser, f"{IMU1} .figures")))
    canvas_of(browser)
    call("pause", imu="imu1")
    wait_for_shade(browser, "unsent", 1.2)
    wait_until("words for it", lambda: text(browser, f"{IMU1} .state") == "nothing sent: output paused")
    wait_until("the caption", lambda: text(browser, f"{IMU1} .values caption").startswith("Nothing is sent: output paused, at "))
    assert any(y is not None for y in check_not_sent(browser)["x truth"])
    assert names_above(browser)[-1] == "output paused", names_above(browser)
    lane, area = browser.execute_script("const chart = Chart.getChart(arguments[0]); return [chart.$lanes, chart.chartArea].map(({top, bottom}) => [top, bottom])",
                                        canvas_of(browser))
    assert lane[1] - lane[0] > 12 and lane[1] <= area[0], f"names at {lane} and curves at {area}"
    browser.refresh()
    wait_until("the pause in a new page", lambda: names_above(browser) == ["output paused"])
    call("resume", imu="imu1")
    wait_until("samples again", lambda: "samples/s" in text(browser, f"{IMU1} .figures"))
    wait_until("no state", lambda: text(browser, f"{IMU1} .state") == "")


def check_marks(browser):
    """Without truth the motion is extrapolated for a second, then held; then, as the configuration is changed, nothing is sent."""
    for word in ("extrapolated", "held", "nothing sent"):
        assert word in text(browser, "#shades"), text(browser, "#shades")
    canvas_of(browser)
    call("set", **{"truth.extrapolate_ms": 1000})
    wait_until("truth", lambda: re.search(r"truth \d+\.\d Hz", text(browser, "#truth")))
    browser.execute_script("document.querySelector('#together').open = true")
    imud.truth.send_signal(signal.SIGSTOP)
    try:
        wait_for_shade(browser, "extrapolated", 0.8)
        wait_for_shade(browser, "held", 1)
        wait_until("words for it", lambda: "motion held" in text(browser, f"{IMU1} .state"))
        wait_until("the header's words", lambda: re.match(r"truth stopped [\d.]+ s ago, at \d", text(browser, "#truth")))
        assert "Hz" not in text(browser, "#truth"), text(browser, "#truth")
        call("set", **{"truth.when_stopped": "silence"})
        wait_for_shade(browser, "unsent", 1)
        for name in ("imu1", 'tail \\"left\\"'):  # the second one is closed
            wait_until(f"words of {name}", lambda: text(browser, f'[data-imu="{name}"] .state') == "nothing sent: no truth")
        wait_until("the caption", lambda: text(browser, f"{IMU1} .values caption").startswith("Nothing is sent: no truth, at "))
        check_not_sent(browser)
        marks = lambda: {row["name"]: set(row["marks"]) for row in plot(browser, "Rate x", "#together")["rows"]}  # noqa: E731
        wait_until("both marks of both imus", lambda: list(marks()) == ["imu1", 'tail "left"'] and all({"held", "unsent"} <= of for of in marks().values()))
    finally:
        imud.truth.send_signal(signal.SIGCONT)
    call("set", **{"truth.extrapolate_ms": 100, "truth.when_stopped": "hold"})
    browser.execute_script("document.querySelector('#together').open = false")
    # What is not marked is not shaded: when truth comes again, or a little later.
    wait_until("a second without a mark", lambda: unmarked(browser))
    wait_until("the header's words", lambda: text(browser, "#truth").startswith("run "))


def unmarked(browser):
    shown = plot(browser, "Rate of")
    end_s = max((s["end_s"] for s in shown["shaded"]), default=shown["begin_s"])
    return shown["end_s"] - end_s > 1


def check_gap(browser):
    """No line is drawn across a time without samples."""
    part = f"document.querySelector('{IMU1}').open = "
    browser.execute_script(part + "false")
    wait_for_samples(browser)
    wait_for_samples(browser)
    browser.execute_script(part + "true")
    curve = lambda: plot(browser, "Rate of")["curves"]["x"]  # noqa: E731
    wait_until("a break", lambda: any(y is None for _, y in curve()))
    for (x1, y1), (x2, y2) in zip(points := curve(), points[1:]):
        assert x2 - x1 < 0.1 or y1 is None or y2 is None, f"a line from {x1} s to {x2} s"


def value_at(curve, x):
    """Interpolates between the points of a curve."""
    (x1, y1), (x2, y2) = next((p, q) for p, q in zip(curve, curve[1:]) if p[0] <= x <= q[0])
    return y1 + (y2 - y1) * (x - x1) / (x2 - x1)


def check_together(browser):
    """Both imus are in one plot, on the same time: the clock of the first began at 0 before the truth, that of the second with the
    truth at 100 s."""
    browser.execute_script("document.querySelector('#together').open = true")
    both = lambda: plot(browser, "Rate x", "#together")  # noqa: E731
    wait_until("two curves", lambda: both() and both()["axis"] == "clock of imu1, s" and len(both()["curves"]) == 2 and all(len(c) > 50 for c in both()["curves"].values()))
    one, other = ([p for p in curve if p[1] is not None] for curve in both()["curves"].values())
    differences = [abs(y - value_at(one, x)) for x, y in other[-50:] if one[0][0] <= x <= one[-1][0]]
    assert len(differences) > 20, (one[-3:], other[-3:])
    assert max(differences) < 0.15, max(differences)
    call("fault.begin", imu="imu1", target="gyro.x", kind="bias", value=0.1, for_s=1)
    wait_until("the fault's span", lambda: {"name": "imu1", "spans": ["gyro.x bias"]} in [
        {key: row[key] for key in ("name", "spans")} for row in both()["rows"]])
    browser.save_screenshot(str(pictures / "together.png"))
    browser.execute_script("document.querySelector('#together').open = false")


def check_percentiles(browser):
    """The median of the lateness is a figure of its own, not a limit of the histogram's classes (1, 2, 5, 10 us and so on)."""
    def is_figure():
        shown = re.search(r"late p50 ([\d.]+) (µs|ms)", text(browser, f"{IMU1} .figures"))
        return shown and shown[1].strip("0.") not in ("1", "2", "5")
    wait_until("a figure", is_figure)


def check_idle(browser):
    """Idle connections leave room for another visitor."""
    host, port = imud.address.split(":")
    idle = [socket.create_connection((host, int(port))) for _ in range(40)]
    browser.refresh()
    wait_until("the page", lambda: browser.execute_script("return !!document.querySelector('.values td')"))
    assert text(browser, "#connection") == "connected"
    for connection in idle:
        connection.close()


def check(browser):
    browser.get(f"http://{imud.address}/")
    wait_until("the first plot", lambda: plot(browser, "Rate of"))
    for part in (check_axes, check_freeze, check_zoom, check_save, check_units, check_quantities, check_solution, check_gap, check_together, check_percentiles, check_pause,
                 check_marks, check_idle):
        print(part.__name__, flush=True)
        part(browser)
        expect_no_errors(browser)


imud = Imud(sys.argv[1], sys.argv[2], imus=TWO_IMUS + FILTER, start_s=100, arguments=("--set", "earth.frame=local", "--set", "earth.latitude_deg=45", "--set",
                                                 "earth.longitude_deg=7", "--set", "earth.height_m=500"))
try:
    check_in_browser(check, pictures / "plots_failed.png")
finally:
    code = imud.stop()
    print("".join(imud.log))
assert code == 0, f"imud has ended with {code}"
