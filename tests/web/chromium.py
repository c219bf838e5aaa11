"""Chromium without a window, driven by Selenium."""
import shutil
import sys

chromium, driver = shutil.which("chromium"), shutil.which("chromedriver")
if not chromium or not driver:
    sys.exit("chromium or chromedriver is missing: install them by tools/setup")
from selenium import webdriver  # noqa: E402
from selenium.webdriver.chrome.service import Service  # noqa: E402


def open_browser():
    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--window-size=1280,1400",
                     "--force-prefers-reduced-motion", "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    return webdriver.Chrome(service=Service(driver), options=options)


def check_in_browser(check, picture):
    """Calls check(browser). If it fails, the picture has what the browser showed, and its log is printed."""
    browser = open_browser()
    try:
        check(browser)
    except BaseException:
        browser.save_screenshot(str(picture))
        print(*browser.get_log("browser"), sep="\n")
        raise
    finally:
        browser.quit()


def expect_no_errors(browser):
    errors = [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]
    assert not errors, errors


# Returns the shown text of the first element of a selector in one step, because the page may replace its elements at any time.
TEXT = "return document.querySelector(arguments[0])?.innerText ?? '';"


def text(browser, selector):
    return browser.execute_script(TEXT, selector)


# Returns the page's width beyond that of the window.
OVERHANG = "return document.documentElement.scrollWidth - document.documentElement.clientWidth;"


def save_picture(browser, path, width, scheme):
    """Saves the page as a window of that many pixels shows it, in the colour scheme "light" or "dark". It must fit in."""
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": scheme}]})
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {"width": width, "height": 1000, "deviceScaleFactor": 1, "mobile": width < 500})
    assert browser.execute_script(OVERHANG) == 0, f"wider than {width} pixels"
    browser.save_screenshot(str(path))
