"""The page of the study is deterministic, and written completely or not at all. Captures are left out for speed."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from erm.common.errors import DataError
from erm.letter import corridor, published, routes
from erm.letter.captures import UNCHANGED, Campaign, Change, Measured
from erm.letter.methods import SINGLE
from erm.letter.published import TABLE_2
from erm.letter.scatter import printed_signs, scatter
from erm.letter.study import PAGE, run
from erm.letter.sweeps import SweptParameter
from erm.letter.truth import as_table, rays_of
from sounder.campaign import study

pytestmark = pytest.mark.slow
QUICK = (SweptParameter("RX spacing", "m", (20.0, 10.0), 10.0, None),)

FEW = {name for names in TABLE_2.values() for name in list(names)[:5]} | {"RX9_L", "RX16_L"}


class Ideal:
    """Sees every path to one bounce with a small error; breaks down after a number of campaigns."""

    def __init__(self, breaks_after: int = 100) -> None:
        self.left = breaks_after

    def campaign(self, scene: str) -> Campaign:
        full = study.campaign(scene)
        if scene == "lroom":
            return full.at(full.links[::4])
        return full.at([link for link in full.links if link.name in FEW])

    def measure(
        self, campaign: Campaign, change: Change = UNCHANGED, *, progress: Callable[[], None] | None = None
    ) -> Measured:
        if self.left == 0:
            raise DataError("the amplifier burnt out")
        self.left -= 1
        rng = np.random.default_rng(5)
        table = as_table(campaign, rays_of(campaign.to_order(1)))
        size = table.sizes["mpc"]
        spread = {"delay": 5e-12, "azimuth": 0.02}
        errors = {name: table[name] + std * rng.standard_normal(size) for name, std in spread.items()}
        std = {f"{name}_std": ("mpc", np.full(size, value)) for name, value in spread.items()}
        return Measured(
            table.assign(errors | std), np.full(size, 30.0), {link.name: xr.Dataset() for link in campaign.links}
        )

    def draw_daps(self, products, axes):
        axes.set_rlim(0, 100)
        return axes


@pytest.fixture(scope="module", autouse=True)
def brief() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("erm.letter.sweeps.DENSEST", 10.0)  # m, of the positions that a route is predicted from
        patch.setattr("erm.letter.sweeps.OFFSETS", (0.0, 6.0))
        patch.setattr("erm.letter.prediction.COUNTS", (5,))
        yield


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> Path:
    return run(tmp_path_factory.mktemp("letter"), Ideal(), parameters=QUICK)


def test_the_page_shows_every_figure_that_is_written_as_pdf_and_png(page):
    text = page.read_text(encoding="utf-8")
    drawn = {path.name for path in (page.parent / "figures").iterdir()}
    assert drawn == {f"{Path(name).stem}.{suffix}" for name in drawn for suffix in ("pdf", "png")}
    assert all(f"figures/{name})" in text for name in drawn)
    assert len(drawn) == 2 * text.count("![Figure")


def test_the_page_says_how_the_print_must_be_read(page):
    text = page.read_text(encoding="utf-8")
    assert "What the letter calls RMSE is the standard deviation" in text
    assert "Its formula of D_Error has three slips" in text
    assert "| Route 1 | (a) from the printed points | 10 | 0.0915 | 3.77 | 1.62 | 1.28 | 2.06 |" in text
    assert "| Route 2 | (a) from the printed points | 8 | 0.01 | 1.71 | 0.62 | 0.45 | 0.766 |" in text


def test_every_route_keeps_its_bars_with_ideal_captures(page):
    text = page.read_text(encoding="utf-8")
    assert text.count("holds") >= 8
    assert "**missed**" not in text


def test_two_runs_give_the_same_numbers(page, tmp_path, monkeypatch):
    monkeypatch.setattr("erm.common.page.FORMATS", ())  # that figures repeat themselves is shown for one of them
    again = run(tmp_path, Ideal(), parameters=QUICK)
    assert again.read_bytes() == page.read_bytes()


def test_a_study_that_fails_leaves_no_page_beside_figures_that_are_not_its_own(tmp_path, monkeypatch):
    monkeypatch.setattr("erm.common.page.FORMATS", ("svg",))
    (tmp_path / PAGE).write_text("of an earlier run")
    for campaigns, left in ((1, [PAGE]), (5, ["figures", "parity.csv", "reflection_points.csv", "table_3.csv"])):
        with pytest.raises(DataError, match="burnt out"):
            run(tmp_path, Ideal(breaks_after=campaigns), parameters=QUICK)
        assert sorted(path.name for path in tmp_path.iterdir()) == left


def test_the_corridor_is_as_wide_as_printed_and_seen_from_inside_alone():
    campaign = study.campaign("uma")
    # the ordinates are printed to the centimetre, 65.30 - 50.38
    assert corridor.width_of(campaign.environment) == pytest.approx(14.92, abs=1e-9)
    assert corridor.seen_by(campaign)["teaching building"] == 0
    route = [replace(link, tx=corridor.TX_INSIDE) for link in campaign.links if link.name in TABLE_2[corridor.ROUTE]]
    assert set(corridor.seen_by(campaign.at(route)).values()) == {7}


def test_signs_of_the_printed_errors_keep_their_sizes():
    for route, values in published.errors().items():
        np.testing.assert_allclose(np.abs(printed_signs()[route]), values)


def test_an_error_of_the_length_makes_the_rmse_it_is_fitted_to():
    studied = routes.study(Ideal().campaign("uma"), Ideal())
    for one in scatter(studied):
        assert np.hypot(one.mean, one.std) == pytest.approx(one.rmse, rel=1e-6)
        printed = published.TABLE_3[published.COLUMN_OF_ROUTE[one.route]]
        if printed["mean"] / printed["RMSE"] > 1.33:  # that of a normal error without a bias: sqrt(2 / (pi - 2))
            assert (one.biased_mean, one.biased_std) == pytest.approx((printed["mean"], printed["RMSE"]), rel=0.01)
        assert one.planar > 0.5  # 27 m of height in 60 to 110 m of length: points behind the face by metres


def test_without_the_letters_limits_the_errors_are_those_of_the_components():
    studied = routes.study(Ideal().campaign("uma"), Ideal())
    off, *_, on = routes.limits(studied)
    assert (off.planar, off.azimuths, off.delays, on.planar, on.azimuths, on.delays) == (False,) * 3 + (True,) * 3
    for route, errors in routes.errors_by_route(studied).items():
        np.testing.assert_allclose(off.error[route], errors[SINGLE], atol=1e-9)
        assert on.error[route].mean() > 10 * off.error[route].mean()
