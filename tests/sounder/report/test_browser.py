"""The page in headless Chromium: choose a wall, sort and filter, no error on the console."""

import json

import pytest

pytestmark = pytest.mark.slow


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
        arrow = "getComputedStyle(document.querySelector('[aria-sort=" + direction + "] button'), '::after').content"
        assert run(arrow) == {"ascending": '" ▲"', "descending": '" ▼"'}[direction]
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


EVERY = """
const problems = [];
const say = (what, right) => { if (!right) problems.push(what); };
const tip = () => [...document.getElementsByClassName("tooltip")].map((one) => one.textContent).join("");
const details = document.getElementById("details");
say("marks", document.querySelectorAll("#map .mark").length > 5);
for (const mark of document.querySelectorAll("#map .mark")) {
  const name = mark.dataset.key;
  mark.dispatchEvent(new PointerEvent("pointermove", { clientX: 5, clientY: 5, bubbles: true }));
  say(`hover ${name}`, tip().length > 0);
  mark.dispatchEvent(new PointerEvent("pointerleave", { bubbles: true }));
  mark.dispatchEvent(new MouseEvent("click", { bubbles: true }));
  say(`click ${name}`, mark.classList.contains("chosen"));
  const links = details.querySelectorAll("button.link").length;
  for (let i = 0; i < links; i += 1) {
    mark.dispatchEvent(new MouseEvent("click", { bubbles: true }));
    const link = details.querySelectorAll("button.link")[i];
    const before = details.textContent;
    link.click();
    say(`link ${name} ${link.textContent}`, details.textContent !== before);
  }
}
for (const id of ["daps", "pdp", "loss"])
  for (const dot of document.querySelectorAll(`#${id} svg [data-tip], #${id} svg circle`))
    dot.dispatchEvent(new PointerEvent("pointermove", { clientX: 5, clientY: 5, bubbles: true }));
for (const box of document.querySelectorAll("#map-tools input[type=checkbox]")) {
  box.click();
  box.click();
}
for (const table of ["parameter-table", "mpc-table"]) {
  const host = document.getElementById(table);
  const rows = () => [...host.querySelectorAll("tbody tr")];
  const all = rows().length;
  host.querySelectorAll("th[scope=col]").forEach((head, i) => {
    for (const direction of ["ascending", "descending"]) {
      head.querySelector("button").click();
      say(`${table}: sort ${i} ${direction}`, head.getAttribute("aria-sort") === direction && rows().length === all);
    }
    const search = host.querySelector("input[type=search]");
    for (const text of [rows()[0].cells[i].textContent.trim().split(/\\s+/)[0], ""]) {
      search.value = text;
      search.dispatchEvent(new Event("input"));
      say(`${table}: filter ${text}`, rows().length > 0 && rows().length <= all);
    }
  });
  for (const pick of host.querySelectorAll("tbody button.link")) {
    pick.click();
    say(`${table}: row ${pick.textContent}`, details.textContent.includes(pick.textContent));
  }
}
for (const id of ["next", "previous"]) {
  const before = document.getElementById("position").value;
  document.getElementById(id).click();
  say(id, document.getElementById("position").value !== before);
}
for (const option of document.getElementById("parameter").options) {
  document.getElementById("parameter").value = option.value;
  document.getElementById("parameter").dispatchEvent(new Event("change"));
  say(`parameter ${option.text}`, document.querySelectorAll("#distribution svg").length === 1);
}
for (const link of document.querySelectorAll("a[href^='#']"))
  say(`anchor ${link.hash}`, document.getElementById(link.hash.slice(1)) !== null);
return problems;
"""


@pytest.fixture
def shown(request, browser):
    """The page of the street, or that of the demo, in the browser."""
    path = request.getfixturevalue(request.param)
    browser.get((path if path.is_file() else path / "report.html").as_uri())
    browser.set_script_timeout(300)
    return browser


@pytest.mark.parametrize("shown", ["page", "demo"], indirect=True)
def test_every_mark_link_sort_and_filter_answers(shown):
    browser = shown
    assert browser.execute_script(EVERY) == []
    assert browser.get_log("browser") == []


def test_charts_have_numbers_on_both_axes_and_tell_lines_apart(browser, page):
    """Distances of 13 to 20 m hold no power of ten and only one of 1, 2, 5 times one."""
    browser.get(page.as_uri())
    for name in ("daps", "pdp", "loss"):
        texts = browser.find_elements("css selector", f"#{name} svg text[text-anchor=middle]")
        assert sum(one.text.replace(".", "").isdigit() for one in texts) >= 3, name
    entries = browser.execute_script(
        "return [...document.querySelectorAll('#pdp .swatch')].map((one) => one.className)"
    )
    assert len(set(entries)) == len(entries) == 4  # PDP, threshold, noise floor, MPCs


def test_printed_tables_lose_no_column(browser, page):
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    size = {"width": 1032, "height": 700, "deviceScaleFactor": 1, "mobile": False}  # A4 less 12 mm, 96 to the inch
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    browser.get(page.as_uri())
    regions = browser.find_elements("class name", "scroll")
    wide = [one for one in regions if one.get_property("scrollWidth") > one.get_property("clientWidth")]
    named = [one.get_attribute("aria-label") for one in wide]
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
    assert (len(regions) > 4, named) == (True, [])
