"""The page of `sounder demo` in headless Chromium: a real pointer, real links, and numbers that its files have too."""

import json
from urllib.parse import unquote, urlsplit

import numpy as np
import pytest

import erm

pytestmark = pytest.mark.slow

FREE = """
const [selector, index] = arguments;
const mark = document.querySelectorAll(selector)[index];
mark.scrollIntoView({ block: "center" });
const matrix = mark.getScreenCTM();
const box = mark.getBoundingClientRect();
const count = [...Array(99).keys()];
const places = !mark.matches("circle") && mark.getTotalLength() > 0.01
  ? count.map((i) => mark.getPointAtLength(((i + 1) / 100) * mark.getTotalLength()).matrixTransform(matrix))
  : count.slice(0, 17).flatMap((i) => count.slice(0, 17).map((k) =>
      new DOMPoint(box.x + box.width / 2 + i - 8, box.y + box.height / 2 + k - 8)));
const pixels = places.map(({ x, y }) => [Math.round(x), Math.round(y)]);
return pixels.find(([x, y]) => document.elementFromPoint(x, y) === mark) || null;
"""
"""A pixel of a mark in the window that no other mark covers."""


@pytest.fixture
def opened(browser, demo):
    browser.set_window_size(1280, 1000)
    browser.get((demo / "report.html").as_uri())
    yield browser
    assert browser.get_log("browser") == []


def point_at(browser, selector: str, index: int = 0):
    """Move the pointer to a mark; None if others cover all of it."""
    actions = pytest.importorskip("selenium.webdriver.common.actions.action_builder").ActionBuilder(browser)
    place = browser.execute_script(FREE, selector, index)
    if place is None:
        return None
    actions.pointer_action.move_to_location(*place)
    actions.perform()
    return actions


def tip(browser) -> str:
    return browser.find_element("class name", "tooltip").text


def test_each_wall_and_pole_tells_its_mpcs(opened, demo):
    found = erm.read_map(demo / "map.geojson").reflectors
    kinds = found["kind"].values.tolist()
    assert kinds.count("wall") == 10
    for number, support in enumerate(found["support"].values):
        name = f"{kinds[number]} {number}"
        actions = point_at(opened, f"[data-key=reflector-{number}]")
        assert tip(opened) == f"{name}, {support} MPCs"
        actions.pointer_action.click()
        actions.perform()
        details = opened.find_element("id", "details")
        assert details.find_element("tag name", "h3").text == name
        assert f"{support} MPCs of " in details.text
        assert len(details.find_elements("css selector", "li button")) == support
        assert len(opened.find_elements("css selector", "#map .rp.chosen")) == support


@pytest.mark.parametrize(
    ("selector", "told"),
    [
        ("#map .wall", "MPCs"),
        ("#map .pole", "MPCs"),
        ("#map .rp", "MPC of RX"),
        ("#map .rx", "line of sight"),
        ("#map .tx", "TX of RX"),
        ("#daps circle", "MPC of RX"),
        ("#pdp circle", "MPC of RX"),
        ("#loss circle", "dB"),
    ],
)
def test_each_kind_of_mark_answers_the_pointer(opened, selector, told):
    marks = len(opened.find_elements("css selector", selector))
    reached = next(number for number in range(marks) if point_at(opened, selector, number))
    assert told in tip(opened), (selector, reached)
    opened.find_element("tag name", "h1").click()
    assert tip(opened) == ""


def test_links_lead_to_sections_and_to_files_that_exist(opened, demo):
    page = opened.current_url
    targets = [link.get_attribute("href") for link in opened.find_elements("css selector", "a[href]")]
    sections = [target for target in targets if "#" in target]
    assert len(sections) == 9
    for target in sections:
        opened.get(target)
        top = opened.execute_script("return document.querySelector(':target').getBoundingClientRect().top")
        assert -1 < top < 1000, target
    files = [target for target in targets if target not in sections]
    assert len(files) == 3
    for target in files:
        assert not urlsplit(target).netloc
        assert (demo / unquote(urlsplit(target).path)).stat().st_size > 0
    opened.get(page)


def test_filters_and_sorts_agree_with_the_products(opened, demo):
    table, _ = erm.read_mpcs(sorted((demo / "products").iterdir()))
    search = opened.find_element("id", "mpc-table-filter")
    count = opened.find_element("css selector", "#mpc-table [role=status]")
    for name, scale in {"delay": 1e9, "azimuth": 1, "elevation": 1, "path_gain": 1}.items():
        values = np.round(table[name].values * scale, 3)
        middle = round(float(np.median(values)), 1) + 0.05
        for sign, agree in (("<", values < middle), (">", values > middle)):
            search.clear()
            search.send_keys(f"{name.replace('_', '')}{sign}{middle:.2f}")
            assert f"of {agree.sum()} rows, {len(values)} in all" in count.text
    search.clear()
    search.send_keys("RX2_L")
    assert f" {(table['position'] == 'RX2_L').values.sum()} rows" in count.text
    search.clear()
    search.send_keys(" ")
    opened.find_element("xpath", "//div[@id='mpc-table']//button[.='Show all rows']").click()
    delay = opened.find_element("xpath", "//div[@id='mpc-table']//th[contains(., 'delay [ns]')]/button")
    for order in (1, -1):
        delay.click()
        column = "[...document.querySelectorAll('#mpc-table tbody tr')].map(row => parseFloat(row.cells[1].innerText))"
        shown = order * np.array(json.loads(opened.execute_script(f"return JSON.stringify({column})")))
        assert len(shown) == table.sizes["mpc"]
        assert np.all(np.diff(shown) >= -0.1)  # as rounded to its own error


def test_each_position_has_its_daps_pdp_and_mpcs(opened, demo):
    select = pytest.importorskip("selenium.webdriver.support.ui").Select
    table, _ = erm.read_mpcs(sorted((demo / "products").iterdir()))
    chosen = select(opened.find_element("id", "position"))
    names = [option.text for option in chosen.options]
    assert sorted(names) == sorted(path.stem for path in (demo / "products").iterdir())
    pictures = set()
    for name in names:
        chosen.select_by_visible_text(name)
        mpcs = int((table["position"] == name).values.sum())
        for chart in ("daps", "pdp"):
            assert f"of {name}: " in opened.find_element("css selector", f"#{chart} figcaption").text
            assert len(opened.find_elements("css selector", f"#{chart} circle")) == mpcs, (name, chart)
        image = opened.find_element("css selector", "#daps image")
        assert opened.execute_async_script("arguments[0].decode().then(() => arguments[1](true))", image)
        pictures.add(image.get_attribute("href"))
        assert opened.find_element("css selector", "#pdp path").get_attribute("d").count("L") > 50
        assert opened.find_element("css selector", "#details h3").text == name
    assert len(pictures) == len(names)


@pytest.mark.parametrize("width", [1280, 390])
def test_no_serious_finding_of_axe(opened, width):
    """All folded parts open, a wall chosen; on a phone nothing is wider than the screen."""
    axe = pytest.importorskip("axe_core_python.selenium", reason="axe-core-python is not installed")
    size = {"width": width, "height": 844, "deviceScaleFactor": 1, "mobile": width < 500}
    opened.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    opened.refresh()
    opened.execute_script("for (const one of document.querySelectorAll('details')) one.open = true")
    shown = "section { content-visibility: visible !important }"  # axe skips the contrast of what is not drawn
    opened.execute_script(
        "document.head.append(Object.assign(document.createElement('style'), { textContent: arguments[0] }))", shown
    )
    opened.execute_script("document.querySelector('[data-key=reflector-0]').dispatchEvent(new MouseEvent('click'))")
    opened.set_script_timeout(300)
    found = axe.Axe().run(opened)["violations"]
    overflow = opened.execute_script("return document.documentElement.scrollWidth - window.innerWidth")
    opened.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    assert [(one["impact"], one["id"], one["nodes"][0]["html"]) for one in found] == []
    assert overflow <= 0
