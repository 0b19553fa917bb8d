"""Random places: what turns, shifts, mirrors or reorders the measurement does the same to the map and nothing else."""

from typing import NamedTuple

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.constants import c

from erm.geometry.vertical import azimuth_of, unit
from erm.mpcs.selection import select
from erm.reconstruction.reconstruct import reconstruct

from .bounces import bounces, joined

DELAY_STD, AZIMUTH_STD = 1e-10, 0.5
random_places = settings(max_examples=12, deadline=None, derandomize=True)


class Frame(NamedTuple):
    """A turn by an angle [degree], after a mirror if asked for, and a shift [m]."""

    angle: float
    shift: np.ndarray
    mirror: bool

    def points(self, xy):
        turned = np.array(xy, dtype=float) * [1, -1 if self.mirror else 1]
        return turned @ np.stack([unit(self.angle), unit(self.angle + 90)]) + self.shift

    def azimuths(self, azimuth):
        return self.angle + (-azimuth if self.mirror else azimuth)

    def table(self, table):
        moved = table.copy(deep=True)
        for name in ("tx_position", "rx_position"):
            moved[name][:, :2] = self.points(table[name].values[:, :2])
        moved["azimuth"][:] = self.azimuths(table["azimuth"].values)
        return moved


def place(seed):
    """Noisy single bounces off two to four walls about a square, double ones off two of them, direct paths, strays."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(6, 16))
    rx = np.column_stack([rng.uniform(-15, 15, (count, 2)), np.full(count, 1.5)])
    txs = rng.uniform([-15, -15, 4], [15, 15, 12], (int(rng.integers(1, 3)), 3))
    tx, rx = np.repeat(txs, count, axis=0), np.tile(rx, (len(txs), 1))
    turn = rng.uniform(0, 90)
    sides = rng.permutation(4)[: rng.integers(2, 5)]
    walls = [(turn + 90 * side + rng.uniform(-8, 8), -rng.uniform(20, 40)) for side in sides]
    parts = [bounces(tx, rx, loss=0.0), *(bounces(tx, rx, wall, loss=rng.uniform(5, 9)) for wall in walls)]
    seen = rng.random(len(tx)) < 0.5
    parts.append(bounces(tx[seen], rx[seen], walls[0], walls[1], loss=16.0))
    stray = bounces(tx, rx, (0.0, -300.0), loss=14.0)
    direct = np.linalg.norm(tx - rx, axis=-1)
    stray |= {"delay": (direct + rng.uniform(2, 60, len(tx))) / c, "azimuth": rng.uniform(0, 360, len(tx))}
    table = joined([*parts, stray], DELAY_STD, AZIMUTH_STD, seed)
    if rng.random() < 0.5:  # otherwise the errors are to be found
        table["delay_std"][:], table["azimuth_std"][:] = DELAY_STD, AZIMUTH_STD
    return table


def frames(seed):
    rng = np.random.default_rng([seed, 7])
    return Frame(rng.uniform(0, 360), rng.uniform(-500, 500, 2), bool(rng.integers(2)))


def numbers(environment, frame=None):
    """Ends (reflector, 4), variances and support of all reflectors, put in order by what no frame changes."""
    table = environment.reflectors
    ends = table["end_points"].values
    if frame is not None:
        ends = frame.points(ends)
    ends = np.where((ends[:, :1, :1] > ends[:, 1:, :1]), ends[:, ::-1], ends)  # an end is a first one by its east
    across = np.sqrt(table["covariance"].values[:, 0, 0])
    rows = np.column_stack([ends.reshape(-1, 4), across, table["support"].values, table["top"].values])
    return rows[np.lexsort(np.round(rows[:, :4], 3).T)]


@random_places
@given(st.integers(0, 10**6))
@pytest.mark.slow
def test_the_frame_of_a_place_is_that_of_its_map(seed):
    table, frame = place(seed), frames(seed)
    here, merged = reconstruct(select(table))
    there, merged_there = reconstruct(select(frame.table(table)))
    np.testing.assert_allclose(numbers(there), numbers(here, frame), rtol=1e-5, atol=1e-5)
    np.testing.assert_array_equal(merged_there["accepted"], merged["accepted"])
    np.testing.assert_array_equal(merged_there["reason"], merged["reason"])


@random_places
@given(st.integers(0, 10**6))
@pytest.mark.slow
def test_the_order_of_components_and_positions_does_not_matter(seed):
    table = place(seed)
    rng = np.random.default_rng([seed, 3])
    order = rng.permutation(table.sizes["mpc"])
    names = {name: f"P{number}" for number, name in enumerate(rng.permutation(np.unique(table["position"].values)))}
    mixed = table.isel(mpc=order)
    mixed["position"] = ("mpc", np.array([names[name] for name in mixed["position"].values]))
    here, merged = reconstruct(select(table))
    there, merged_there = reconstruct(select(mixed))
    np.testing.assert_allclose(numbers(there), numbers(here), rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(merged_there["reason"], merged["reason"][order])


@random_places
@given(st.integers(0, 10**6))
@pytest.mark.slow
def test_a_campaign_that_was_copied_says_no_more_than_once(seed):
    table = place(seed)
    table["delay_std"][:], table["azimuth_std"][:] = DELAY_STD, AZIMUTH_STD
    copy = table.copy(deep=True)
    copy["position"] = ("mpc", np.char.add(table["position"].values, " again"))
    here, _ = reconstruct(select(table))
    there, _ = reconstruct(select(xr.concat([table, copy], dim="mpc")))
    once, twice = numbers(here), numbers(there)
    # what lies on the edge of a gate may fall to either side, as the number of all paths counts in what is chance
    walls = {"once": once[once[:, 4] > 0], "twice": twice[twice[:, 4] > 0]}
    assert len(walls["once"]) == len(walls["twice"])
    assert np.all(np.abs(walls["twice"][:, 5] - walls["once"][:, 5]) <= 1)
    assert np.all(walls["twice"][:, 4] > 0.9 * walls["once"][:, 4])  # twice the paths would have 0.71


@random_places
@given(st.integers(0, 10**6), st.floats(0, 180))
@pytest.mark.slow
def test_receivers_on_any_line_give_walls_within_their_errors(seed, bearing):
    rng = np.random.default_rng(seed)
    tx = np.array([*rng.uniform(-10, 10, 2), 8.0])
    start = rng.uniform(-10, 10, 2)
    rx = np.column_stack([start + np.linspace(-12, 12, 10)[:, None] * unit(bearing), np.full(10, 1.5)])
    wall = (float(azimuth_of(-np.array([[1.0, 0.0]]))[0]) + rng.uniform(-20, 20), -35.0)
    table = joined([bounces(np.tile(tx, (10, 1)), rx, wall)], DELAY_STD, AZIMUTH_STD, seed)
    table["delay_std"][:], table["azimuth_std"][:] = DELAY_STD, AZIMUTH_STD
    environment, _ = reconstruct(select(table), max_gap=np.inf)
    assert environment.reflectors.sizes["reflector"] == 1
    found = environment.reflectors.isel(reflector=0)
    error = np.array([(found["normal"].item() - wall[0] + 180) % 360 - 180, found["offset"].item() - wall[1]])
    # chi-squared of two degrees of freedom: one in a hundred thousand exceeds 23
    assert error @ np.linalg.solve(found["covariance"].values, error) < 23


@pytest.mark.slow
def test_the_frame_is_told_apart():
    # the tests above compare something: another frame gives another map
    table = place(1)
    here, _ = reconstruct(select(table))
    assert here.reflectors.sizes["reflector"] >= 2
    with pytest.raises(AssertionError):
        np.testing.assert_allclose(numbers(here), numbers(here, frames(1)), rtol=1e-5, atol=1e-5)
