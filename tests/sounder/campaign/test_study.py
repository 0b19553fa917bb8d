"""The claims of the letter's study, with simulated captures of a part of the positions."""

import tomllib
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from erm.common.errors import DataError
from erm.letter import room, routes
from erm.letter.captures import Change
from erm.letter.methods import MERGED
from erm.letter.published import TABLE_2
from sounder.campaign import study


@pytest.fixture(scope="module")
def uma():
    return study.campaign("uma")


def test_the_entry_point_has_every_function_that_the_study_asks_for():
    declared = tomllib.loads((Path(__file__).parents[3] / "pyproject.toml").read_text(encoding="utf-8"))
    (module,) = declared["project"]["entry-points"]["erm.captures"].values()
    laboratory = import_module(module)
    assert all(callable(getattr(laboratory, name)) for name in ("campaign", "measure", "draw_daps"))


def test_the_positions_are_at_the_published_distances(uma):
    # the scene's coordinates are rounded to 0.1 mm, the letter's distances to 0.1 m
    distance = {link.name: link.distance for link in uma.links}
    for positions in TABLE_2.values():
        for name, printed in positions.items():
            assert distance[name] == pytest.approx(printed, abs=1e-3)


@pytest.mark.parametrize("bandwidth", [0.3e9, 0.6e9, 1.2e9, 2.4e9, 4.8e9])
def test_the_longest_unambiguous_path_stays_when_the_bandwidth_changes(uma, bandwidth):
    # 2**m - 1 chips at a rate in proportion to 2**m: less than a chip of the shortest sequence is lost, 1 in 127
    scene = study.apply_change(uma.instrument, Change(bandwidth=bandwidth))
    period = uma.instrument.sounder.waveform.period
    assert scene.sounder.waveform.period == pytest.approx(period, rel=1 / 127)
    assert scene.sounder.waveform.sample_rate == bandwidth


def test_a_beam_twice_as_wide_has_half_the_gain(uma):
    plain, wide = (study.apply_change(uma.instrument, Change(beamwidth=width)).sounder.rx_antenna for width in (10, 20))
    assert plain.gain - wide.gain == pytest.approx(10 * np.log10(2))


def test_a_change_that_makes_no_instrument_is_refused(uma):
    with pytest.raises(DataError, match=r"polynomial|order"):
        study.apply_change(uma.instrument, Change(bandwidth=0.1e9))


@pytest.mark.slow
def test_the_same_seed_measures_the_same(uma):
    first, second = (study.measure(uma.at(uma.links[:1])) for _ in range(2))
    assert first.mpcs.identical(second.mpcs)
    assert first.daps["RX1_L"].identical(second.daps["RX1_L"])


@pytest.mark.slow
def test_merged_walls_keep_the_bars_on_a_part_of_each_route(uma):
    # every route's bar is 0.05 m, and 20 times better than the planar method on the same captures
    kept = [name for positions in TABLE_2.values() for name in list(positions)[:5]]
    studied = routes.study(uma.at([link for link in uma.links if link.name in kept]), study)
    errors = routes.errors_by_route(studied)
    found = {route: bar for route, bar in routes.improvements(errors).items() if len(errors[route][MERGED])}
    assert set(found) == set(TABLE_2)
    for rmse, times in found.values():
        assert rmse <= 0.05
        assert times >= 20


@pytest.mark.slow
def test_the_room_keeps_its_bars_on_every_other_position():
    # mean 0.005 m and RMSE 0.010 m of the full distance to the rays' points
    campaign = study.campaign("lroom")
    part = campaign.at(campaign.links[::2])
    sensed = room.sense(part, study, Change(noise=False, snapshots=1))
    planar, _, merged = (row.statistics for row in sensed.rows)
    assert merged["count"] >= 10
    assert merged["mean"] <= 0.005
    assert merged["rmse"] <= 0.010
    assert planar["rmse"] > 20 * merged["rmse"]
