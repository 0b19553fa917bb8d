"""Chains of reflections locate the walls that they met."""

import numpy as np
import pytest
import xarray as xr
from scipy.constants import c

from erm.geometry.vertical import angle_difference, mirrored
from erm.mpcs.reasons import Reason
from erm.mpcs.selection import select
from erm.reconstruction import reconstruct as module
from erm.reconstruction.bundle_walls import Adjusted
from erm.reconstruction.decision.chains import predict_chains
from erm.reconstruction.model.line import Lines
from erm.reconstruction.model.loss import reflection_loss
from erm.reconstruction.reconstruct import reconstruct
from erm.reconstruction.rounds import reconstruct_survey
from erm.survey.bundle import SurveyStd

from .bounces import FREQUENCY, bounces, joined

TX = np.array([-40.0, 2.0, 12.0])
STREET = np.array([[90.0, -9.0], [270.0, -10.0]])  # y = -9 and y = 10, seen from between
ORDERS = [(0,), (1,), (0, 1), (1, 0), (0, 1, 0), (1, 0, 1)]


def street(delay_std, azimuth_std, seed, orders=ORDERS, count=8):
    """Paths along a street that its two sides, of a refractive index of 2, reflect once, twice and three times."""
    rng = np.random.default_rng([seed, 1])
    rx = np.column_stack([np.linspace(-15, 45, count), rng.uniform(-6, 7, count), np.full(count, 1.5)])
    tx = np.tile(TX, (count, 1))
    parts = []
    for chain in orders:
        part = bounces(tx, rx, *STREET[list(chain)])
        across = np.sin(np.deg2rad(part["azimuth"])) * np.cos(np.arcsin(10.5 / (c * part["delay"])))
        loss = len(chain) * reflection_loss(4.0, np.abs(across))  # both sides are met at one angle
        parts.append(part | {"path_gain": bounces(tx, rx, *STREET[list(chain)], loss=loss)["path_gain"]})
    table = joined(parts, delay_std, azimuth_std, seed)
    table["delay_std"][:], table["azimuth_std"][:] = max(delay_std, 1e-12), max(azimuth_std, 0.01)
    return table


def errors_and_chi2(environment):
    """Errors (wall, 2) of (normal, offset) and chi-squared (wall,) of both."""
    table = environment.reflectors
    normal, offset, covariance = (table[name].values for name in ("normal", "offset", "covariance"))
    _, first = np.unique(normal, return_index=True)
    true = STREET[[int(np.argmin(np.abs(angle_difference(STREET[:, 0], normal[i])))) for i in first]]
    error = np.column_stack([angle_difference(normal[first], true[:, 0]), offset[first] - true[:, 1]])
    return error, np.einsum("wi,wij,wj->w", error, np.linalg.inv(covariance[first]), error)


@pytest.mark.parametrize("chain", [(0,), (1, 0), (0, 1, 2), (2, 0, 2)])
def test_slopes_of_a_chain_are_those_of_its_prediction(chain):
    values = np.array([[88.0, -9.0], [272.0, -10.0], [171.0, -50.0]])
    pivot = np.array([[3.0, -9.0], [-2.0, 9.0], [50.0, 1.0]])
    rx = np.array([[20.0, 3.0, 1.5]])

    def at(step=0.0, wall=0, parameter=0):
        moved = values.copy()
        moved[wall, parameter] += step
        return predict_chains(
            TX[None], rx, np.array([chain]), Lines(moved[:, 0], moved[:, 1], np.zeros((3, 2, 2)), pivot)
        )

    for wall in set(chain):
        met = np.array(chain) == wall
        for parameter in range(2):
            up, down = at(1e-4, wall, parameter), at(-1e-4, wall, parameter)
            slope = at().length_slope[0, met, parameter].sum(), at().azimuth_slope[0, met, parameter].sum()
            # central differences of 1e-4: their own error is of the order 1e-8
            assert slope[0] == pytest.approx((up.length[0] - down.length[0]) / 2e-4, abs=1e-6)
            turned = float(angle_difference(up.azimuth[0], down.azimuth[0])) / 2e-4
            assert slope[1] == pytest.approx(turned, abs=1e-6)


def test_exact_chains_leave_exact_walls_and_get_their_reason():
    environment, merged = reconstruct(select(street(0.0, 0.0, 0)), max_gap=np.inf)
    error, _ = errors_and_chi2(environment)
    assert np.abs(error).max() < 1e-6
    single = np.arange(merged.sizes["mpc"]) < 16
    assert merged["accepted"].values.tolist() == single.tolist()
    assert set(merged["reason"].values[~single]) == {Reason.MULTIPLE_REFLECTION}


@pytest.mark.slow
def test_chains_make_walls_better_and_their_covariance_stays_right():
    with_chains, without, chi2 = [], [], []
    for seed in range(40):
        environment, _ = reconstruct(select(street(1e-10, 0.5, seed)), max_gap=np.inf)
        error, one = errors_and_chi2(environment)
        chi2 += one.tolist()
        with_chains += error[:, 1].tolist()
        environment, _ = reconstruct(select(street(1e-10, 0.5, seed, ORDERS[:2])), max_gap=np.inf)
        without += errors_and_chi2(environment)[0][:, 1].tolist()
    # three reflections meet the sides of the street three times as steeply as one; 80 errors give a spread to 8 %
    assert np.std(with_chains) < 0.6 * np.std(without)
    # mean of 80 chi-squared values of 2 degrees of freedom, those of a draw not independent: 2 +- 0.32 at most
    assert np.mean(chi2) == pytest.approx(2, abs=3 * 0.32)


@pytest.mark.slow
def test_no_chain_is_used_where_as_many_would_be_found_by_chance(monkeypatch):
    # 200 clutter paths per link and large errors: each chain has some in its gate, and as many around it
    rng = np.random.default_rng(3)
    table = street(3e-10, 3.0, 3, ORDERS[:2])
    clutter = street(3e-10, 3.0, 4, [(0, 1)] * 200)
    direct = np.linalg.norm(clutter["tx_position"].values - clutter["rx_position"].values, axis=-1)
    clutter["delay"][:] = (direct + rng.uniform(2, 60, len(direct))) / c
    clutter["azimuth"][:] = rng.uniform(0, 360, len(direct))
    free_space = 20 * np.log10(c / FREQUENCY / (4 * np.pi * clutter["delay"].values * c))
    clutter["path_gain"][:] = free_space - rng.uniform(10, 40, len(direct))
    both = select(xr.concat([table, clutter], dim="mpc"))
    dense, _ = reconstruct(both, max_gap=np.inf)
    none = np.empty(0, dtype=np.int64)
    monkeypatch.setattr(module, "bundle_walls", lambda *given: Adjusted(given[2], given[3], none, given[4]))
    alone, _ = reconstruct(both, max_gap=np.inf)
    assert alone.reflectors.sizes["reflector"] >= 2
    np.testing.assert_array_equal(dense.reflectors["offset"], alone.reflectors["offset"])


def test_images_of_two_walls_are_images_of_images():
    # what `predict_chains` says of a double reflection, by hand
    image = mirrored(mirrored(TX[:2], *STREET[0]), *STREET[1])
    rx = np.array([[20.0, 3.0, 1.5]])
    lines = Lines(STREET[:, 0], STREET[:, 1], np.zeros((2, 2, 2)), np.zeros((2, 2)))
    found = predict_chains(TX[None], rx, np.array([[0, 1]]), lines)
    horizontal = np.linalg.norm(image - rx[0, :2])
    assert found.length[0] == pytest.approx(np.hypot(horizontal, 10.5))


@pytest.mark.slow
def test_chains_do_not_pull_positions():
    table = street(1e-10, 0.5, 1, count=16)
    moved = 0.2 * np.random.default_rng(2).standard_normal((16, 2))
    rx, number = np.unique(table["rx_position"].values, axis=0, return_inverse=True)
    surveyed = table["rx_position"].values.copy()
    surveyed[:, :2] += moved[number.ravel()]
    table = table.assign(rx_position=(("mpc", "xyz"), surveyed))
    _, located = reconstruct_survey(table, SurveyStd(0.2, 0.0, 0.0), common=False)
    place = located["survey_rx"].values[:, None, :2]
    nearest = np.argmin(np.linalg.norm(place - rx[:, :2], axis=-1), axis=1)
    apart = located["survey_rx"].values[:, :2] - rx[nearest, :2]
    # 32 normalised errors: their mean square is 1, to 0.25
    assert np.mean((apart / located["survey_rx_std"].values) ** 2) < 1.75
