"""The page in headless Chromium: choose a wall, sort and filter, no error on the console."""

import json
import shutil

import pytest

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def browser():
    webdriver = pytest.importorskip("selenium.webdriver", reason="Selenium is not installed")
    chromium, driver = shutil.which("chromium"), shutil.which("chromedriver")
    if not (chromium and driver):
        pytest.skip("there is no chromium with its chromedriver")
    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--window-size=1200,900"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    made = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    yield made
    made.quit()


def test_the_page_answers(browser, page, contents):
    def run(script: str):
        return json.loads(browser.execute_script(f"return JSON.stringify({script})"))

    def column(number: int) -> list[str]:
        return run(f"[...document.querySelectorAll('#parameter-table tbody tr')].map(r => r.cells[{number}].innerText)")

    browser.get(page.as_uri())
    # a wall tells of its MPCs, each of its antenna pair
    wall = browser.find_element("css selector", "#map .wall")
    aside = int(wall.rect["width"] / 4)  # the middle of the wall is a reflection point
    actions = pytest.importorskip("selenium.webdriver").ActionChains(browser)
    actions.move_to_element_with_offset(wall, aside, 0).click().perform()
    assert browser.find_element("class name", "tooltip").text == "wall 0, 3 MPCs"
    details = browser.find_element("id", "details")
    assert "wall 0" in details.text
    assert "3 MPCs of 3 antenna pairs" in details.text
    details.find_elements("css selector", "li button")[1].click()
    assert "antenna pair" in details.text
    assert "RX2" in details.text
    assert run("document.getElementById('position').selectedOptions[0].text") == "RX2"
    # keyboard: every position of the map can be chosen
    browser.execute_script("document.querySelector('[data-key=position-0]').focus()")
    browser.switch_to.active_element.send_keys("\ue007")
    assert details.find_element("css selector", "h3").text == "RX1"
    # sort: first click up, second down; the header says so
    spread = browser.find_element("xpath", "//div[@id='parameter-table']//th[contains(., 'RMS delay spread')]")
    shown = []
    for direction in ("ascending", "descending"):
        spread.find_element("css selector", "button").click()
        assert spread.get_attribute("aria-sort") == direction
        shown.append(column(0))
    assert shown == [["RX1", contents.names[2], "RX2"], ["RX2", contents.names[2], "RX1"]]
    # filters: a text, and a comparison
    for text, found in (("rx2", 1), ("pathloss>92", 2), ("pathloss>92 rx2", 1), ("nothing", 0)):
        search = browser.find_element("id", "parameter-table-filter")
        search.clear()
        search.send_keys(text)
        assert len(column(0)) == found, text
    # zoom: the view is smaller, and comes back
    widths = []
    for label in ("Zoom in", "Zoom out"):
        browser.find_element("css selector", f"[aria-label='{label}']").click()
        widths.append(float(run("document.querySelector('#map svg').getAttribute('viewBox')").split()[2]))
    assert widths[0] < widths[1]
    for name in ("daps", "pdp", "distribution", "loss"):
        assert run(f"document.querySelectorAll('#{name} svg').length") == 1
    assert browser.get_log("browser") == []
