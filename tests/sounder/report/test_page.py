"""The page: one file that needs no network, in which no text of a user becomes markup."""

import base64
import json
from html.parser import HTMLParser
from io import BytesIO

import matplotlib
import numpy as np
import pytest
import xarray as xr
from matplotlib.image import imread

from sounder.figures.products import POWER_MAP
from sounder.report.numbers import ellipse
from sounder.report.page import page_data
from sounder.report.spectra import reduce_daps, reduce_pdp

from .conftest import HOSTILE, NAMES, daps

VOID = {"meta", "br", "input", "link", "img"}


class Structure(HTMLParser):
    """Elements, their attributes and texts; refuses tags that are not closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: dict[str, list[str]] = {}
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open:
            self.texts.setdefault(self.open[-1], []).append(data)

    def attributes(self, name: str) -> list[str]:
        return [value or "" for _, attributes in self.elements for key, value in attributes.items() if key == name]


@pytest.fixture(scope="module")
def structure(page) -> Structure:
    return Structure(page.read_text(encoding="utf-8"))


@pytest.mark.slow
def test_texts_of_users_are_texts(structure):
    assert structure.texts["h1"] == [HOSTILE]
    assert structure.texts["title"] == [HOSTILE]
    assert [tag for tag, _ in structure.elements].count("script") == 2  # the data and the program
    assert [text for text in structure.texts["li"] if text == HOSTILE] == [HOSTILE, HOSTILE]
    data = json.loads(structure.texts["script"][0])
    assert [one["name"] for one in data["positions"]] == list(NAMES)


def test_the_page_needs_nothing_else(structure):
    assert structure.attributes("src") == []
    assert "link" not in [tag for tag, _ in structure.elements]
    links = structure.attributes("href")
    assert [link for link in links if not link.startswith("#")] == ["a%20b%23.csv"]
    targets = {link.removeprefix("#") for link in links if link.startswith("#")}
    assert targets <= set(structure.attributes("id"))  # each link within the page leads somewhere


def test_the_page_can_be_read_aloud(structure):
    assert ("html", {"lang": "en"}) in structure.elements
    identifiers = structure.attributes("id")
    assert len(identifiers) == len(set(identifiers))
    assert set(structure.attributes("aria-labelledby")) <= set(identifiers)
    for tag, attributes in structure.elements:
        assert tag != "th" or attributes["scope"] in {"row", "col"}
    tables = [tag for tag, _ in structure.elements].count("table")
    assert len([text for text in structure.texts["caption"] if text.strip()]) == tables > 0


def test_the_data_say_which_mpcs_a_wall_has(contents):
    data = page_data(contents)
    (wall,) = data["reflectors"]
    assert wall["kind"] == "wall"
    mpcs = data["mpcs"]
    on_wall = [i for i, reflector in enumerate(mpcs["reflector"]) if reflector == 0]
    assert [mpcs["position"][i] for i in on_wall] == [0, 1, 2]
    for i in on_wall:  # each bounce is on the line y = 10
        assert mpcs["point"][i][1] == pytest.approx(10.0, abs=0.01)
    assert wall["support"] == len(on_wall) == 3
    assert [len(one["failures"]) for one in data["positions"]] == [0, 1, 1]
    assert {fit["model"] for fit in data["fits"]} == {"close in", "floating intercept"}
    (spread,) = [one for one in data["parameters"]["columns"] if one["key"] == "rms_delay_spread"]
    assert (spread["unit"], spread["values"], spread["errors"]) == ("ns", [10.0, 30.0, 20.0], [])


def test_a_reduced_daps_keeps_the_strongest_sample_of_each_cell(contents, monkeypatch):
    table = contents.located.isel(mpc=contents.located["position"].values == NAMES[0])
    scan = daps(table)
    monkeypatch.setattr("sounder.report.spectra.MAX_CELLS", 40)
    monkeypatch.setattr("sounder.report.spectra.MAX_BINS", 10)
    made = reduce_daps(scan)
    pixels = imread(BytesIO(base64.b64decode(made["picture"])))[::-1]  # the last row is the first azimuth
    assert made["bins"] <= 10
    assert pixels.shape == (4, made["bins"], 4)
    brightest = matplotlib.colormaps[POWER_MAP](1.0)
    for delay, azimuth in zip(table["delay"].values * 1e9, table["azimuth"].values, strict=True):
        cell = round((delay - made["first"]) / made["step"])
        assert pixels[round(azimuth / 90) % 4, cell] == pytest.approx(brightest, abs=1 / 255)
    assert (pixels[..., 3] == 0).sum() >= pixels[..., 0].size - 2 * len(table["delay"])  # noise is left out
    pdp = reduce_pdp(scan, xr.Dataset(attrs={"threshold": "usc"}))
    assert max(pdp["power"]) == -130.0
    assert (pdp["floor"], pdp["threshold"], pdp["made"]) == (-170.0, -158.0, "strongest beam")


@pytest.mark.parametrize("angle", [0.0, 30.0, -75.0])
def test_an_ellipse_has_the_axes_of_its_covariance(angle):
    turn = np.radians(angle)
    axes = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    rng = np.random.default_rng(1)
    points = rng.standard_normal((20_000, 2)) * (2, 0.5) @ axes.T
    large, small, found = ellipse(axes @ np.diag([4.0, 0.25]) @ axes.T)
    assert found == angle
    back = points @ axes / (large, small)
    # the share of 20 000 points has a standard deviation of sqrt(0.95 0.05 / 20 000) = 0.0015
    assert np.mean(np.sum(back**2, axis=1) < 1) == pytest.approx(0.95, abs=0.006)
    assert ellipse(np.full((2, 2), np.nan)) is None
