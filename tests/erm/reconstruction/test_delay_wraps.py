"""Delays known modulo a period: longer ones are accepted only where several positions then agree."""

import numpy as np
import pytest
import xarray as xr

from erm.common.constants import c
from erm.maps.environment import Environment
from erm.mpcs.selection import MAX_GAIN_EXCESS, reflection_loss, select
from erm.mpcs.table import columns_of_product, free_space_gain, make_table, path_length
from erm.reconstruction.delay_wraps import _hypotheses
from erm.reconstruction.model.paths import Paths
from erm.reconstruction.reconstruct import reconstruct
from erm.tracing.trace import trace

FREQUENCY, TX = 132e9, np.array([0.0, 0.0, 12.0])
PERIOD = 300e-9  # s; 90 m
# the far wall's paths are 115 to 165 m longer than the direct ones: one period and a part of the next
NEAR, FAR = [[-10.0, 12.0], [45.0, 12.0]], [[-20.0, -80.0], [80.0, -80.0]]
SQUARE = Environment.walls(np.array([NEAR, FAR]), top=30.0, material="concrete")
EARLY = 1e-9  # s; before the direct path, where the period of a product begins


def square(*, period=PERIOD, known=True, seed=3):
    """Single reflections and direct paths at twelve places, delays wrapped, with errors."""
    rng = np.random.default_rng(seed)
    parts = []
    for number in range(12):
        rx = np.array([rng.uniform(-5, 40), rng.uniform(-20, 9), 1.5])
        paths = trace(SQUARE, TX, rx, FREQUENCY, max_order=1)
        first = np.linalg.norm(TX - rx) / c - EARLY
        delay = first + (paths["delay"].values - first) % period
        n = paths.sizes["path"]
        measured = {
            "delay": delay + 1e-11 * rng.standard_normal(n),
            "azimuth": paths["azimuth"].values + 0.1 * rng.standard_normal(n),
            "elevation": paths["elevation"].values + 0.2 * rng.standard_normal(n),
            "path_gain": paths["path_gain"].values,
            "wrap_period": np.where(paths["los"].values, np.nan, period) if known else np.full(n, np.nan),
        }
        errors = {"delay_std": 1e-11, "azimuth_std": 0.1, "elevation_std": 0.2, "path_gain_std": 0.3}
        ends = {"position": f"RX{number}", "tx_position": TX, "rx_position": rx, "frequency": FREQUENCY}
        parts.append(make_table(ends | measured | errors))
    return xr.concat(parts, dim="mpc")


def offsets(environment):
    """Distances of the walls from the origin [m]."""
    return np.abs(environment.reflectors["offset"].values)


@pytest.mark.slow
def test_a_far_wall_with_wrapped_delays_is_located():
    environment, located = reconstruct(select(square()))
    assert np.abs(offsets(environment) - 80.0).min() < 0.01
    far = int(np.argmin(np.abs(offsets(environment) - 80.0)))
    of_far = located["wall"].values == far
    assert of_far.sum() >= 10
    assert (located["periods"].values[of_far] >= 1).all()
    assert (located["periods"].values[~of_far] == 0).all()
    np.testing.assert_allclose(located["reflection_point"].values[of_far, 1], -80.0, atol=0.5)
    given = square()["delay"].values
    np.testing.assert_allclose(located["delay"].values - given, located["periods"].values * PERIOD, atol=1e-15)


@pytest.mark.slow
def test_a_wall_whose_delays_wrapped_as_often_as_their_gains_allow_is_located():
    # the far wall's paths are four to six periods longer: as measured neither elevations nor losses are a wall's
    environment, located = reconstruct(select(square(period=90e-9)))
    far = int(np.argmin(np.abs(offsets(environment) - 80.0)))
    assert abs(offsets(environment)[far] - 80.0) < 0.02
    assert located["periods"].values[located["wall"].values == far].max() > 3


@pytest.mark.slow
def test_hypotheses_end_where_a_path_would_be_stronger_than_free_space():
    table = select(square(period=90e-9))
    one = np.flatnonzero(np.isfinite(table["wrap_period"].values))
    measured = Paths.from_table(table)
    wrapped, paths = _hypotheses(table, measured, np.isin(np.arange(table.sizes["mpc"]), one))
    assert (wrapped["reflection_loss"].values > -MAX_GAIN_EXCESS - 2 * wrapped["reflection_loss_std"].values).all()
    assert (wrapped["reflection_loss"].values <= table.attrs["max_reflection_loss"]).all()
    # with one period more, the longest would be stronger than free space, or beyond where the weakest path is received
    longest = wrapped.isel(mpc=[int(np.argmax(wrapped["delay"].values))])
    longer = longest.assign(delay=longest["delay"] + longest["wrap_period"])
    stronger = reflection_loss(longer) + 2 * longer["reflection_loss_std"].values < -MAX_GAIN_EXCESS
    weakest = (table["path_gain"] + 2 * table["path_gain_std"]).values.min()  # for certain
    beyond = free_space_gain(path_length(longer), FREQUENCY) < weakest
    assert (stronger | beyond).all()
    count = np.bincount(paths.row)
    assert count.max() > 2
    # any one of them may agree with others by chance
    assert (paths.clutter >= (1 - 1e-9) * measured.clutter[paths.row] * count[paths.row]).all()


@pytest.mark.slow
def test_without_a_period_delays_are_not_changed():
    environment, located = reconstruct(select(square(known=False)))
    assert (np.abs(offsets(environment) - 80.0) > 1.0).all()
    assert (located["periods"].values == 0).all()


@pytest.mark.slow
def test_delays_that_did_not_wrap_are_not_changed():
    long = square(period=10e-6)
    expected, _ = reconstruct(select(long))
    flagged = long.assign(wrap_period=("mpc", np.where(np.isfinite(long["wrap_period"]), 850e-9, np.nan)))
    environment, located = reconstruct(select(flagged))
    xr.testing.assert_identical(environment.reflectors, expected.reflectors)
    assert (located["periods"].values == 0).all()


def test_two_positions_are_no_evidence_of_a_wrapped_wall():
    table = square()
    few = table.isel(mpc=np.isin(table["position"].values, ("RX0", "RX1")))
    environment, located = reconstruct(select(few), min_support=2)
    assert (located["periods"].values == 0).all()
    assert environment.reflectors.sizes["reflector"] < 2


def test_receivers_in_line_with_an_image_do_not_give_its_distance():
    # too weak for a wall as measured, and strong enough two periods later
    east = np.linspace(10.0, 45.0, 8)
    ends = {"tx_position": [0.0, 0.0, 1.5], "rx_position": np.column_stack([east, np.zeros(8), np.full(8, 1.5)])}
    length = 150.0 - east
    gain = 20 * np.log10(c / FREQUENCY / (4 * np.pi * length)) - 22.0
    errors = {"delay_std": 1e-11, "azimuth_std": 0.2, "elevation_std": 0.5, "path_gain_std": 0.3}
    values = {"delay": length / c, "azimuth": 0.0, "path_gain": gain, "wrap_period": 850e-9, "frequency": FREQUENCY}
    table = make_table({"position": np.array([f"RX{i}" for i in range(8)])} | ends | values | errors)
    environment, located = reconstruct(select(table))
    assert environment.reflectors.sizes["reflector"] == 0
    assert (located["periods"].values == 0).all()


@pytest.mark.parametrize("attributes", [{"period": 8e-7}, {}])
def test_the_period_is_that_of_the_product(attributes):
    values = {name: ("mpc", np.zeros(3)) for name in ("delay", "azimuth", "elevation", "path_gain")}
    product = xr.Dataset(values | {"may_be_wrapped": ("mpc", np.array([0, 1, 0]))}, attrs=attributes)
    expected = attributes.get("period", np.nan)
    np.testing.assert_array_equal(columns_of_product(product)["wrap_period"], [np.nan, expected, np.nan])
