"""Reflections off vertical cylinders: Fermat's principle, slopes, and the limits of flat faces and thin poles."""

import numpy as np
import pytest

from erm.geometry.cylinders import bounce, reflection_azimuths, spreading_factor
from erm.geometry.vertical import horizontal_length, reflection_point, unit


@pytest.mark.parametrize("seed", range(10))
def test_all_points_where_the_length_is_stationary_are_found(seed):
    rng = np.random.default_rng(seed)
    centre, radius = rng.normal(size=2), np.exp(rng.uniform(-3, 4))
    tx, rx = centre + radius * np.exp(rng.uniform(-1, 2)) * rng.normal(size=(2, 2))
    azimuth = np.linspace(0, 360, 36001)
    n = unit(azimuth)
    to_tx, to_rx = tx - centre - radius * n, rx - centre - radius * n
    length = np.linalg.norm(to_tx, axis=-1) + np.linalg.norm(to_rx, axis=-1)
    turns = np.flatnonzero(np.diff(np.sign(np.diff(np.r_[length, length[1]]))) != 0) + 1
    same_side = (np.sum(n * to_tx, axis=-1) * np.sum(n * to_rx, axis=-1))[turns % 36000] > 0
    found = reflection_azimuths(tx, rx, centre, radius)
    # a sample next to the turning point: within 0.02 degrees
    assert np.sort(found[np.isfinite(found)]) == pytest.approx(np.sort(azimuth[turns[same_side]]), abs=0.02)


@pytest.mark.parametrize("radius", [0.1, 3.0, 500.0, -30.0])
def test_what_a_bounce_measures_gives_its_point_and_normal_back(radius):
    """A path off any face locates it in closed form: p = c + a n."""
    rng = np.random.default_rng(3)
    tx, rx = rng.uniform(-9, 9, (2, 8, 3))
    centre = np.array([-radius - 12.0, 0.0])  # the face is 12 m west of the origin
    found = bounce(tx, rx, centre, radius, 0.0)
    slant = np.hypot(found.length, tx[:, 2] - rx[:, 2])
    point, normal = reflection_point(tx, rx, slant, found.azimuth)
    assert point == pytest.approx(found.point, abs=1e-8)
    assert unit(normal) == pytest.approx(unit(found.normal), abs=1e-8)
    assert centre + radius * unit(normal) == pytest.approx(point, abs=1e-6 * abs(radius))
    assert horizontal_length(tx, rx, slant) == pytest.approx(found.length, rel=1e-12)


@pytest.mark.parametrize("radius", [0.3, 40.0, -25.0])
def test_slopes_are_differences(radius):
    rng = np.random.default_rng(5)
    tx, rx = rng.uniform(-6, 6, (2, 6, 2))
    centre = np.array([-radius - 9.0, 1.0])
    found = bounce(tx, rx, centre, radius, 0.0)
    step = 1e-5
    for number, move in enumerate(np.eye(3) * step):
        ends = [bounce(tx, rx, centre + s * move[:2], radius + s * move[2], found.normal) for s in (1, -1)]
        for name in ("length", "azimuth"):
            change = (getattr(ends[0], name) - getattr(ends[1], name)) / (2 * step)
            assert getattr(found, f"{name}_slopes")[:, number] == pytest.approx(change, abs=2e-5)


def test_nothing_is_reflected_between_antennas_on_different_sides():
    assert np.isnan(bounce([-5.0, 0.0], [5.0, 0.0], [0.0, 0.0], 1.0, 90.0).normal)
    found = reflection_azimuths([-5.0, 0.1], [5.0, 0.1], [0.0, 0.0], 1.0)
    assert np.sum(np.isfinite(found)) == 2  # above and below, where a tangent face would reflect


def test_spreading_is_that_of_the_lens_equation():
    """A concave face of focal length a cos / 2 makes an image where 1 / s1 + 1 / s2 = 2 / (a cos): infinite power."""
    assert spreading_factor(10.0, 30.0, -15.0, 1.0, 1.0) == np.inf
    assert spreading_factor(10.0, 30.0, 0.01, 0.5, 1.0) == pytest.approx(0.005 / 15, rel=2e-3)
    assert spreading_factor(10.0, 30.0, -5.0, 1.0, 1.0) == spreading_factor(30.0, 10.0, -5.0, 1.0, 1.0)
