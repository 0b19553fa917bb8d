"""A cylinder predicts exact reflections off it, and is found from them with the right covariance."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.constants import c
from scipy.stats import chi2

from erm.maps.environment import Environment
from erm.reconstruction.model.paths import Paths
from erm.reconstruction.poles.cylinder import RADIUS_ERROR, ROUNDNESS, cylinder_residuals, fit_cylinder, refine_cylinder
from erm.reconstruction.poles.point_scatterers import POLE_LOSS_SCATTER
from erm.tracing.trace import trace

from ..bounces import paths_of

FREQUENCY, TX = 132e9, np.array([0.0, 0.0, 6.0])
CENTRE, RADIUS = np.array([30.0, 9.0]), 0.15
AROUND = np.array([[12.0, 14], [25, 1], [41, 3], [47, 12], [22, 20], [35, -5], [52, 6], [18, 4]])
ROW = np.column_stack([np.linspace(15, 60, 8), np.zeros(8)])


def off_pole(places, radius=RADIUS, material="metal", length_std=0.01, azimuth_std=0.3) -> Paths:
    """Exact paths off a pole to receivers at places (n, 2)."""
    scene = Environment.empty().with_poles(CENTRE[None], radius, material=material)
    parts = []
    for place in places:
        rx = np.r_[place, 1.5]
        path = trace(scene, TX, rx, FREQUENCY, max_order=1).isel(path=[-1])
        loss = 20 * np.log10(c / FREQUENCY / (4 * np.pi * path.delay.values * c)) - path.path_gain.values
        parts.append((path.delay.item(), path.azimuth.item(), loss.item(), rx))
    delay, azimuth, loss, rx = (np.array(column) for column in zip(*parts, strict=True))
    columns = {"tx_position": np.tile(TX, (len(rx), 1)), "rx_position": rx, "delay": delay, "azimuth": azimuth}
    return paths_of(columns, length_std, azimuth_std, loss)


def drawn(paths: Paths, rng: np.random.Generator) -> Paths:
    """The same paths with the errors that are assumed, those of roundness and material included."""
    count = len(paths)
    aside = rng.standard_normal(count) * np.hypot(paths.length_std, ROUNDNESS)
    # error of the radius from losses: 3 dB, averaged, and that of the material
    std = np.hypot(RADIUS * (10 ** (POLE_LOSS_SCATTER / np.sqrt(count) / 10) - 1), RADIUS_ERROR)
    by_loss = max(RADIUS + std * rng.standard_normal(), 0.02)
    return replace(
        paths,
        length=paths.length + aside,
        azimuth=paths.azimuth + paths.azimuth_std * rng.standard_normal(count),
        loss=paths.loss - 10 * np.log10(by_loss / RADIUS),
    )


@pytest.mark.parametrize("radius", [0.05, 0.2, 0.8])
def test_paths_off_a_pole_are_as_long_as_by_way_of_its_surface(radius):
    now = cylinder_residuals(off_pole(AROUND, radius), CENTRE, radius)
    # the reflection point is off by radius**2 / distance, the length by the square of that over the radius; the
    # nearest antenna is 8 m away
    assert np.abs(now.length).max() < (radius**2 / 8) ** 2 / radius
    # the reflection point is seen from at least 8 m
    assert np.abs(now.azimuth).max() < np.rad2deg(radius**2 / 8 / 8)


def test_slopes_are_those_of_the_predictions():
    paths, step = off_pole(AROUND), 1e-4
    now = cylinder_residuals(paths, CENTRE, RADIUS)
    for number, (east, north, more) in enumerate(np.eye(3) * step):
        there = cylinder_residuals(paths, np.add(CENTRE, (east, north)), RADIUS + more)
        np.testing.assert_allclose((now.length - there.length) / step, now.length_slope[:, number], atol=2e-3)
        # as the axis moves, the reflection point also moves round the pole: by the radius over the distance
        turned = (now.azimuth - there.azimuth) / step
        around = np.rad2deg(RADIUS / 8**2)
        np.testing.assert_allclose(turned, now.azimuth_slope[:, number], atol=around)


@pytest.mark.parametrize("radius", [0.05, 0.15, 0.4])
def test_the_centre_of_a_pole_is_on_its_axis_and_not_on_its_surface(radius):
    paths = off_pole(AROUND, radius)
    found = fit_cylinder(paths, np.add(CENTRE, (0.3, -0.2)), 0.1)
    # the error of the reflection point, and nothing of the radius
    assert np.linalg.norm(found.centre - CENTRE) < 0.01
    assert found.radius == pytest.approx(radius, abs=0.01)
    assert found.radius_by_loss == pytest.approx(radius, rel=0.02)


def test_delays_from_several_sides_give_the_radius_of_an_absorbing_pole():
    found = fit_cylinder(off_pole(AROUND, 0.3, "concrete", length_std=0.003), CENTRE, 0.1)
    assert found.radius_by_loss < 0.1  # concrete loses 8 dB and more
    assert np.linalg.norm(found.centre - CENTRE) < 0.03


@pytest.mark.parametrize("places", [AROUND, ROW])
@pytest.mark.slow
def test_the_covariance_of_a_pole_is_right(places):
    """68 +- 7 % of 300 draws lie within the ellipse of 68 %; one standard deviation of that share is 2.7 %."""
    rng, exact, count = np.random.default_rng(4), off_pole(places), 300
    inside = 0
    for _ in range(count):
        found = fit_cylinder(drawn(exact, rng), CENTRE, 0.1)
        error = found.centre - CENTRE
        inside += error @ np.linalg.solve(found.covariance[:2, :2], error) < chi2.ppf(0.6827, 2)
    assert 0.61 <= inside / count <= 0.75


def test_a_thin_pole_with_a_negative_radius_stays_in_place():
    exact = off_pole(AROUND, 0.03)
    longer = cylinder_residuals(exact, CENTRE, 0.03).length_slope[:, 2] * -0.06
    found = fit_cylinder(replace(exact, length=exact.length + longer), CENTRE, 0.1)
    assert found.radius < 0
    assert np.linalg.norm(found.centre - CENTRE) < 0.01


def test_a_pole_drops_paths_that_do_not_agree():
    paths = off_pole(AROUND)
    paths.length[2] += 0.3
    found = refine_cylinder(paths, np.arange(8), np.arange(8), CENTRE, 0.1, 3)
    assert found is not None
    assert found[1].tolist() == [0, 1, 3, 4, 5, 6, 7]
    assert np.linalg.norm(found[0].centre - CENTRE) < 0.01
    assert refine_cylinder(paths, np.arange(4), np.arange(4), CENTRE, 0.1, 4) is None
