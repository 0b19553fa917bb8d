"""Poles and arcs: where they reflect, what they block, and how the wave spreads behind them."""

import numpy as np
import pytest

from erm.maps.environment import Environment
from erm.tracing.cylinders import cylinders_of, reflections
from erm.tracing.trace import trace

FREQUENCY = 132e9
RADIUS = 1e6  # m


def random_pole(seed: int) -> tuple[np.ndarray, np.ndarray, Environment]:
    rng = np.random.default_rng(seed)
    tx, rx = rng.uniform(-20, 20, (2, 3))
    return tx, rx, Environment.empty().with_poles(rng.uniform(-20, 20, (1, 2)), rng.uniform(0.05, 1.0), base=-np.inf)


@pytest.mark.parametrize("seed", range(10))
def test_the_wave_behind_a_pole_spreads_as_a_tube_of_rays_does(seed):
    tx, rx, place = random_pole(seed)
    found = trace(place, tx, rx, FREQUENCY, max_order=1).isel(path=1)
    pole = cylinders_of(place)
    bounce = reflections(pole, tx, rx)
    near = int(np.argmin(np.linalg.norm(bounce.point - found.vertices.values[0], axis=-1)))
    point, normal, radius, centre = bounce.point[near], bounce.normal[near], pole.radius[0], pole.centre[0]
    first = point - tx
    s1, s2 = np.linalg.norm(first), np.linalg.norm(rx - point)
    before, after = first / s1, (rx - point) / s2
    assert np.linalg.norm(np.cross(after - before, normal)) < 1e-8

    def landing(direction: np.ndarray) -> np.ndarray:
        """Where a ray is s1 + s2 from the transmitter, reflected by the cylinder on the way."""
        to, d = tx[:2] - centre, direction[:2]
        a, b, e = d @ d, to @ d, to @ to - radius**2
        run = (-b - np.sqrt(b**2 - a * e)) / a
        hit = tx + run * direction
        n = np.append((hit[:2] - centre) / radius, 0.0)
        return hit + (s1 + s2 - run) * (direction - 2 * (direction @ n) * n)

    ray = before
    side = np.cross(ray, [0, 0, 1])
    side /= np.linalg.norm(side)
    other = np.cross(side, ray)
    # small against the angle left to grazing as the ray walks round the pole: radius cos^2 / s1, 1e-4 of it
    step = 1e-4 * radius * (ray @ normal) ** 2 / s1

    def derivative(tangent: np.ndarray) -> np.ndarray:
        ends = [landing(np.cos(step) * ray + sign * np.sin(step) * tangent) for sign in (1, -1)]
        return (ends[0] - ends[1]) / (2 * step)

    area = np.linalg.norm(np.cross(derivative(side), derivative(other)))
    assert bounce.spreading[near] == pytest.approx(np.sqrt(area), rel=1e-4)


def test_a_pole_between_the_antennas_or_around_one_reflects_nothing():
    for tx in ([-5.0, 0, 1], [0.1, 0, 1]):
        pole = Environment.empty().with_poles([[0.0, 0.0]], 0.3)
        assert trace(pole, tx, [5.0, 0, 1], FREQUENCY).sizes["path"] == 1


@pytest.mark.parametrize("sign", [1, -1])
def test_a_cylinder_of_endless_radius_is_a_wall(sign):
    tx, rx = np.array([5.0, -8.0, 2.0]), np.array([9.0, 12.0, 7.0])
    around = [[-0.01, 0.01]] if sign > 0 else [[179.99, 180.01]]
    arc = Environment.empty().with_arcs([[-sign * RADIUS, 0.0]], sign * RADIUS, around, material="glass")
    wall = Environment.walls([[[0.0, -50.0], [0.0, 50.0]]], material="glass")
    round_, flat = (trace(place, tx, rx, FREQUENCY).isel(path=1) for place in (arc, wall))
    assert round_.path_gain.item() == pytest.approx(flat.path_gain.item(), rel=1e-6)
    # 20 m of a circle are 20**2 / 8 / radius off its chord, at most ten times that aside
    assert round_.vertices.values[0] == pytest.approx(flat.vertices.values[0], abs=10 * 50 / RADIUS)


def test_a_pole_is_a_reflector_of_its_height_that_walls_can_hide():
    tx, rx = np.array([-10.0, 0.0, 3.0]), np.array([10.0, 0.0, 3.0])

    def orders(place: Environment) -> list[int]:
        return trace(place, tx, rx, FREQUENCY).order.values.tolist()

    assert orders(Environment.empty().with_poles([[0.0, 5.0]], 0.2)) == [0, 1]
    assert orders(Environment.empty().with_poles([[0.0, 5.0]], 0.2, top=2.9)) == [0]
    assert orders(Environment.walls([[[-5.0, 1.0], [-4.0, 4.0]]]).with_poles([[0.0, 5.0]], 0.2)) == [0]
    found = trace(Environment.walls([[[0, 90], [1, 90]]]).with_poles([[0.0, 5.0]], 0.2), tx, rx, FREQUENCY)
    assert found.reflector.values[1].tolist() == [1, -3, -3]


def test_a_round_room_focuses_what_its_far_wall_reflects():
    """In a circle of radius r the far wall's reflection between antennas at -x and x has 1 + 2 s1 s2 / (L a)."""
    half = Environment.empty().with_arcs([[0.0, 0.0]], -10.0, [[0.0, 180.0]], material="metal")
    paths = trace(half, [-3.0, 0.0, 1.0], [3.0, 0.0, 1.0], FREQUENCY, max_order=1)
    top = int(np.nanargmax(paths.vertices.values[:, 0, 1]))
    s = np.hypot(3.0, 10.0)
    assert paths.delay.values[top] == pytest.approx(2 * s / 299792458.0, rel=1e-9)
    plane = trace(
        Environment.walls([[[-9.0, 10.0], [9.0, 10.0]]], material="metal"),
        [-3, 0, 1],
        [3, 0, 1],
        FREQUENCY,
        max_order=1,
    )
    focus = -10 * np.log10(abs(1 - s / (10 * (10 / s))))
    assert paths.path_gain.values[top] - plane.path_gain.values[1] == pytest.approx(focus, abs=1e-6)


def test_an_arc_blocks_what_crosses_it_and_reflects_on_both_sides():
    arc = Environment.empty().with_arcs([[0.0, 0.0]], 4.0, [[-60.0, 60.0]], top=3.0)
    inside, outside, behind = [0.0, 1.0, 1.0], [9.0, 1.0, 1.0], [-9.0, 1.0, 1.0]
    assert not trace(arc, inside, outside, FREQUENCY).los.any()
    assert trace(arc, inside, behind, FREQUENCY).los.any()
    assert trace(arc, [0.0, 1.0, 5.0], [9.0, 1.0, 5.0], FREQUENCY).los.any()  # above it
    assert trace(arc, outside, [9.0, 3.0, 1.0], FREQUENCY).order.values.tolist() == [0, 1]
    assert trace(arc, inside, [1.0, -1.0, 1.0], FREQUENCY).order.values.tolist() == [0, 1]


def test_chains_off_a_pole_and_a_wall_are_single_bounces_of_images():
    """The image of an antenna in the wall sees the pole itself, or the image of the pole, once."""
    wall = Environment.walls([[[-30.0, 8.0], [30.0, 8.0]]], top=9.0)
    tx, rx = np.array([-7.0, 1.0, 3.0]), np.array([6.0, -2.0, 1.5])
    place = wall.with_poles([[1.0, 3.0]], 0.3, top=9.0)
    found = trace(place, tx, rx, FREQUENCY, max_order=2, max_cylinder_order=2)
    assert found.sizes["path"] == trace(place, tx, rx, FREQUENCY, max_order=2).sizes["path"] + 2
    only = Environment.empty().with_poles([[1.0, 3.0]], 0.3, top=9.0)
    for order, (first, last) in (
        ([0, 1], (np.array([-7.0, 15.0, 3.0]), rx)),
        ([1, 0], (tx, np.array([6.0, 18.0, 1.5]))),
    ):
        path = found.isel(path=np.flatnonzero((found.reflector.values == order).all(axis=1)).item())
        alone = trace(only, first, last, FREQUENCY).isel(path=1)
        assert float(path.delay) == pytest.approx(float(alone.delay), rel=1e-12)
        assert 0 < float(alone.path_gain - path.path_gain) < 20  # a wall spreads nothing
        legs = np.diff(np.vstack([tx, path.vertices.values, rx]), axis=0)
        assert np.linalg.norm(legs, axis=1).sum() == pytest.approx(float(path.delay) * 299792458.0, rel=1e-12)
