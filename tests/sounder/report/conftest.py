"""The page of a street: one wall, three links, products of a few numbers. Names are those of somebody hostile."""

import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import erm
from erm.common.storage import open_group, provenance, write_product
from erm.reconstruction.make_map import make_map
from sounder.campaign.demo import run_demo
from sounder.parameters.catalogue import PARAMETERS
from sounder.parameters.statistics import campaign_statistics
from sounder.quality.table import tabulate_remarks
from sounder.remark import Code, Remark
from sounder.report.contents import Contents
from sounder.report.page import write_page

HOSTILE = "</script><script>alert(1)</script>&\"'"
NAMES = ("RX1", "RX2", HOSTILE)


def daps(table: xr.Dataset) -> xr.Dataset:
    """DAPS of four azimuths whose samples at the paths stand 40 dB over the noise."""
    delay = 1e-9 * np.arange(200)
    power = np.full((4, 2, 200), -150.0)
    for path, azimuth in zip(table["delay"].values, table["azimuth"].values, strict=True):
        power[round(azimuth / 90) % 4, 1, round(path * 1e9)] = -110.0
    coords = {"azimuth": [0.0, 90.0, 180.0, 270.0], "elevation": [-10.0, 10.0], "delay": delay}
    about = {"long_name": "omnidirectional power delay profile: strongest beam"}
    return xr.Dataset(
        {
            "daps": (("azimuth", "elevation", "delay"), power),
            "noise_floor": (("azimuth", "elevation"), np.full((4, 2), -150.0)),
            "pdp": ("delay", power.max((0, 1)) - 20.0, about),
        },
        coords,
        {"rx_antenna_gain": 20.0},
    )


@pytest.fixture(scope="session")
def contents(tmp_path_factory) -> Contents:
    street = erm.Environment.walls([[[-60, 10], [60, 10]]], top=40.0)
    links = [erm.predict(street, (0, 0, 9), (x, -4, 2), 132e9) for x in (10, 14, 18)]
    links = [
        link.assign(position=("mpc", np.full(link.sizes["mpc"], name))) for link, name in zip(links, NAMES, strict=True)
    ]
    table = xr.concat(links, dim="mpc")
    environment, located = make_map(table, history="test", as_given=True)
    folder = tmp_path_factory.mktemp("page")
    products = {}
    for number, (link, name) in enumerate(zip(links, NAMES, strict=True)):
        places = {f"{end}_position": (("position", "xyz"), link[f"{end}_position"].values[:1]) for end in ("tx", "rx")}
        about = {"los": 1, "recorded_directions": 8, "missing_directions": 0, "problem_directions": 0}
        about |= provenance("Product", "test", options={"threshold": "usc"})
        remarks = [Remark(Code.CLIPPED, azimuth=10.0, elevation=0.0, figure=0.02, bound=0.001)] if number else []
        groups = {
            "/": xr.Dataset(places, {"position": [name]}, about),
            "/daps": daps(link),
            "/mpc": xr.Dataset(attrs={"threshold": "usc"}),
            "/quality": tabulate_remarks(remarks),
        }
        path = folder / f"{number}.h5"
        write_product(groups, path)
        products[path] = open_group(path)
    distance = [float(np.linalg.norm(link["tx_position"][0] - link["rx_position"][0])) for link in links]
    others = {name: ("position", [123.456] * 3) for name in PARAMETERS}  # as wide as the table of positions gets
    others |= {f"{name}_std": ("position", [0.012] * 3) for name in PARAMETERS if name != "rms_delay_spread"}
    parameters = xr.Dataset(
        others
        | {
            "path_loss": ("position", [90.0, 95.0, 99.0]),
            "path_loss_std": ("position", [0.5, 0.5, np.nan]),
            "rms_delay_spread": ("position", [1e-8, 3e-8, 2e-8]),
            "distance": ("position", distance),
            "los": ("position", [1, 1, 1]),
            "frequency": ("position", [132e9] * 3),
            "definition": ("position", [f"from MPCs of {HOSTILE}"] * 3),
        },
        {"position": list(NAMES)},
    )
    return Contents(
        title=HOSTILE,
        summary=[HOSTILE],
        products=products,
        table=table,
        located=located,
        environment=environment,
        parameters=parameters,
        statistics=campaign_statistics(parameters),
        failures=[HOSTILE],
        notes=[HOSTILE],
        settings=[("recordings", HOSTILE)],
        files=["a b#.csv"],
    )


@pytest.fixture(scope="session")
def page(contents, tmp_path_factory):
    return write_page(contents, tmp_path_factory.mktemp("written") / "report.html")


@pytest.fixture(scope="session")
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


@pytest.fixture(scope="session")
def demo(tmp_path_factory) -> Path:
    """Folder of `sounder demo`."""
    folder = tmp_path_factory.mktemp("demo")
    run_demo(folder)
    return folder
