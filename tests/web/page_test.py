"""The page in Chromium: it loads without an error, shows motion, its buttons act, it survives imud's restart, and it fits a
phone. usage: page_test.py IMUD IMU_TRUTH SCREENSHOT_FOLDER"""
import pathlib
import re
import sys

from chromium import OVERHANG, check_in_browser, expect_no_errors, text
from imud_page import NO_PRIORITY, Imud, wait_until
from selenium.common.exceptions import (ElementClickInterceptedException, NoSuchElementException,
                                        StaleElementReferenceException)
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import Select, WebDriverWait

imud_path, truth_path, pictures = sys.argv[1], sys.argv[2], pathlib.Path(sys.argv[3])
pictures.mkdir(parents=True, exist_ok=True)


def error_of_gyro_x(browser):
    return abs(float(text(browser, ".values tr:nth-of-type(2) td:nth-of-type(4)")))


def button(browser, name):
    return browser.find_element(By.XPATH, f"//details[@data-imu='imu1']//button[.='{name}']")


def click(browser, name):
    """Clicks a button of imu1, again if the page has replaced or moved it meanwhile."""
    ignored = (NoSuchElementException, StaleElementReferenceException, ElementClickInterceptedException)
    WebDriverWait(browser, 120, ignored_exceptions=ignored).until(lambda _: button(browser, name).click() or True, name)


# Returns the colours that a canvas has, as a number; an empty one has 1.
COLOURS = """const canvas = arguments[0].querySelector("canvas");
const pixels = new Uint32Array(canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data.buffer);
return new Set(pixels).size;"""


# Returns the element of a cell of the newest sample, and selects its row's name.
CELL = """const cell = document.querySelector("[data-imu=imu1] .values tr:nth-of-type(2) td");
getSelection().selectAllChildren(cell.parentElement.cells[0]);
return cell;"""


def check_tables_stay(browser):
    """New figures are written to the elements that are there: selections stay."""
    cell = browser.execute_script(CELL)
    before = browser.execute_script("return arguments[0].textContent", cell)
    wait_until("another value in the same element", lambda: browser.execute_script("return arguments[0].textContent", cell) != before)
    assert browser.execute_script("return arguments[0].isConnected", cell)
    assert browser.execute_script("return String(getSelection())") == "Rate, rad/s"


def check_buttons_of_faults(browser):
    for name, span in ("Gyro stuck", "gyro stuck"), ("Messages missing", "message missing"), ("Supply off", "power off"):
        click(browser, name)
        wait_until(f"the span of {name}", lambda: span in browser.execute_script("return document.querySelector('.active').textContent"))
    click(browser, "End all faults")
    wait_until("their end", lambda: not browser.execute_script("return document.querySelector('.active').textContent"))
    expect_no_errors(browser)


def check_fault(browser):
    form = browser.find_element(By.CSS_SELECTOR, "[data-imu=imu1] .faults")
    kinds, targets = (Select(select) for select in form.find_elements(By.TAG_NAME, "select"))
    kinds.select_by_visible_text("bias")
    targets.select_by_visible_text("gyro.x")
    value = lambda: form.find_element(By.NAME, "value")  # noqa: E731
    unit = lambda: value().find_element(By.XPATH, "..").text.replace("\n", " ")  # noqa: E731
    assert unit() == "value rad/s" and "rad/s" in value().accessible_name, (unit(), value().accessible_name)
    targets.select_by_visible_text("accelerometer.x")
    assert unit() == "value m/s²", unit()
    kinds.select_by_visible_text("drift")
    assert unit() == "value rad/s/s", unit()
    kinds.select_by_visible_text("bias")
    targets.select_by_visible_text("gyro.x")
    value().send_keys("0.5")
    form.find_element(By.NAME, "for_s").clear()
    click(browser, "Begin fault")
    wait_until("the span of the fault", lambda: "gyro.x bias" in text(browser, ".active"))
    wait_until("the fault in the imu's line", lambda: text(browser, "[data-imu=imu1] .state") == "fault: gyro.x bias")
    wait_until("its effect", lambda: 0.4 < error_of_gyro_x(browser) < 0.6)
    browser.save_screenshot(str(pictures / "fault.png"))
    click(browser, "End gyro.x bias")
    wait_until("its end", lambda: "gyro.x bias" not in text(browser, ".active"))
    wait_until("no effect", lambda: error_of_gyro_x(browser) < 0.1)


def check(browser):
    global imud
    browser.get(f"http://{imud.address}/")
    wait_until("the newest sample of imu1", lambda: browser.execute_script("return !!document.querySelector('.values td')"))
    values = text(browser, ".values")
    wait_until("other values", lambda: text(browser, ".values") != values)
    figures = browser.find_elements(By.CSS_SELECTOR, "[data-imu=imu1] figure")
    assert len(figures) == 5, len(figures)
    for figure in figures:
        wait_until("curves in " + figure.text, lambda: browser.execute_script(COLOURS, figure) > 10)
    for canvas in browser.find_elements(By.CSS_SELECTOR, "[data-imu=imu1] canvas"):
        assert canvas.get_attribute("aria-label"), "a canvas without a label"
    assert "line load" in text(browser, "[data-imu=imu1] .figures"), text(browser, "[data-imu=imu1] .figures")
    assert "samples" in text(browser, "#counters"), text(browser, "#counters")
    for control in browser.find_elements(By.CSS_SELECTOR, "details[open] :is(button, input, select), section :is(button, input)"):
        assert control.accessible_name or not control.is_displayed(), control.get_attribute("outerHTML")
    expect_no_errors(browser)

    # By the keyboard alone, as by a click.
    pause = button(browser, "Pause output")
    pause.send_keys(Keys.ENTER)
    wait_until("paused", lambda: pause.get_attribute("aria-pressed") == "true")
    wait_until("the span of the pause", lambda: "output paused" in text(browser, ".active"))
    wait_until("the pause in the log", lambda: re.search(r"pause, imu imu1, imu1 from sample \d+ at \d+\.\d{3} s", text(browser, "#log")))
    click(browser, "Pause output")
    wait_until("resumed", lambda: pause.get_attribute("aria-pressed") == "false")
    browser.find_element(By.NAME, "text").send_keys("climb <b>begins</b>", Keys.ENTER)
    wait_until("the mark in the log", lambda: "climb <b>begins</b>" in text(browser, "#log"))
    browser.save_screenshot(str(pictures / "page.png"))

    check_fault(browser)
    check_tables_stay(browser)
    check_buttons_of_faults(browser)

    # The second imu is closed until it is asked for, by the keyboard: a click misses it if the page moves meanwhile.
    second = browser.find_element(By.XPATH, "//details[@data-imu='tail \"left\"']")
    assert second.get_attribute("open") is None
    second.find_element(By.TAG_NAME, "summary").send_keys(Keys.ENTER)
    wait_until("the newest sample of the second imu", lambda: second.find_elements(By.CSS_SELECTOR, ".values td"))
    assert browser.execute_script(OVERHANG) <= 0
    expect_no_errors(browser)

    assert imud.stop() == 0
    wait_until("the loss is shown", lambda: "not connected" in text(browser, "#connection"))
    imud = Imud(imud_path, truth_path, realtime=NO_PRIORITY + "epoch = 'monotonic'\n", listen=imud.address)
    wait_until("connected again", lambda: text(browser, "#connection") == "connected")
    wait_until("the clock of the grids", lambda: text(browser, "#truth").endswith(", grids on monotonic, 0 steps"))
    wait_until("values again", lambda: browser.execute_script("return !!document.querySelector('.values td')"))
    assert not browser.find_elements(By.CSS_SELECTOR, "#failure:not([hidden])"), text(browser, "#failure")
    browser.get_log("browser")  # has those of the attempts to connect

    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {"width": 360, "height": 740, "deviceScaleFactor": 2, "mobile": True})
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": "dark"}]})
    wait_until("no horizontal scrolling at phone width", lambda: browser.execute_script(OVERHANG) <= 0)
    back = browser.execute_script("return getComputedStyle(document.body).backgroundColor")
    assert sum(int(n) for n in back[4:-1].split(",")) < 150, f"{back} is not dark"
    browser.save_screenshot(str(pictures / "phone.png"))
    expect_no_errors(browser)


imud = Imud(imud_path, truth_path)
try:
    check_in_browser(check, pictures / "failed.png")
finally:
    code = imud.stop()
    print("".join(imud.log))
assert code == 0, f"imud has ended with {code}"
