"""Without direct paths the clock is not known: walls are found, and their covariances hold what nobody knows."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.constants import c

from erm.mpcs.table import path_length
from erm.reconstruction import rounds
from erm.reconstruction.make_map import make_map
from erm.survey.bundle import SurveyStd
from erm.survey.positions import PositionErrors

from ..survey.streets import street

CLOCK = 4e-9
NORTH, SOUTH = 10.0, -12.0
"""Where the two walls are [m]."""


@pytest.fixture(scope="module", params=[0.0, 4.0])
def heading(request):
    """Common error [degree]; without one, nothing else tells that the table is not calibrated."""
    return request.param


@pytest.fixture(scope="module")
def mapped(heading):
    table = street(16, 2)
    distance = np.linalg.norm(table["tx_position"].values - table["rx_position"].values, axis=-1)
    reflected = np.flatnonzero(path_length(table) > distance + 1.0)
    table = table.isel(mpc=reflected)
    unknown = table["los"] * 0 - 1
    return make_map(
        table.assign(delay=table["delay"] + CLOCK, azimuth=(table["azimuth"] + heading) % 360, los=unknown),
        history="test",
    )


@pytest.mark.slow
@pytest.mark.parametrize("wall", [NORTH, SOUTH])
def test_walls_are_found_to_their_covariances(mapped, wall):
    walls = mapped[0].reflectors
    middle = walls["end_points"].values[:, :, :2].mean(axis=1)
    best = int(np.argmax(walls["support"].values * (np.abs(middle[:, 1] - wall) < 2)))  # the clock is wrong by 1.2 m
    normal = np.deg2rad(walls["normal"].values[best])
    # the distance of the middle from the true wall, and how it moves with (normal [degree], offset)
    left = np.array([-np.sin(normal), np.cos(normal)])
    slope = np.array([-np.deg2rad(left @ middle[best]), 1.0])
    std = np.sqrt(slope @ walls["covariance"].values[best] @ slope)
    assert abs(middle[best, 1] - wall) < 3 * std
    assert std < 1.0


@pytest.mark.slow
def test_heading_is_found_and_the_clock_is_said_to_be_unknown_unless_chains_show_it(mapped, heading):
    attributes = mapped[0].reflectors.attrs
    assert attributes["heading"] == pytest.approx(heading, abs=0.3)
    assert abs(attributes["clock"] - CLOCK) < 3 * attributes["clock_std"]
    known = attributes["clock_std"] < float(np.median(mapped[1]["delay_std"].values)) * 2
    assert known != ("clock" in attributes["ambiguous"].split())
    assert attributes["clock_std"] * c < 2.0


@pytest.mark.parametrize(("clocks", "kept"), [((0.1, 1.0, 2.0), 1.0), ((), 0.0)])
def test_the_clock_is_kept_whose_walls_explain_most_chains(monkeypatch, clocks, kept):
    """Clocks are tried one after another. A later search at another clock that explains less is dropped."""
    table = street(4, 1)
    explained = {0.0: 5.0, 0.1: 2.0, 1.0: 9.0, 2.0: 3.0}
    searched = []

    def located(table, positions, **_):
        clock = float(positions.errors[0, 3])
        searched.append(clock)
        moved = positions.at_clock(0.7)  # wherever it starts, an adjustment leads away
        found = SimpleNamespace(
            clock_std=0.01, common=np.array([0.0, clock]), common_covariance=np.diag([0.1, 0.01]) ** 2
        )
        moved = replace(moved, adjusted=found)
        return SimpleNamespace(evidence=explained.get(round(clock, 1), 0.0), positions=moved, clock=clock)

    monkeypatch.setattr(rounds, "locate_walls", located)
    monkeypatch.setattr(rounds, "from_direct_paths", lambda table, given, **_: PositionErrors.none(table, given))
    monkeypatch.setattr(rounds, "select", lambda table, **_: table)
    monkeypatch.setattr(rounds, "as_map", lambda found, **_: (found.clock, table))
    clock, _ = rounds.reconstruct_survey(table, SurveyStd(0.0, 0.0, 0.0), common=True, clocks=clocks)
    assert clock == pytest.approx(kept)
    np.testing.assert_allclose(searched, [0.0, *clocks, kept + 0.7])
