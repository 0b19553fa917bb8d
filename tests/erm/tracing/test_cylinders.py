"""Poles: where they reflect and how the wave spreads behind them."""

import numpy as np
import pytest

from erm.maps.environment import Environment
from erm.tracing.cylinders import pole_reflections, pole_spreading
from erm.tracing.trace import trace

FREQUENCY = 132e9


def random_pole(seed: int) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(seed)
    tx, rx = rng.uniform(-20, 20, (2, 3))
    return tx, rx, rng.uniform(-20, 20, (1, 2)), rng.uniform(0.05, 1.0, 1)


@pytest.mark.parametrize("seed", range(20))
def test_a_pole_reflections_where_the_path_around_it_is_shortest(seed):
    tx, rx, centre, radius = random_pole(seed)
    point, normal = pole_reflections(tx, rx, centre, radius)
    azimuth = np.linspace(0, 2 * np.pi, 20001)
    circle = centre + radius * np.stack([np.cos(azimuth), np.sin(azimuth)], axis=-1)
    lit = ((tx[:2] - circle) * (circle - centre)).sum(-1) > 0
    lit &= ((rx[:2] - circle) * (circle - centre)).sum(-1) > 0
    if not lit.any():
        assert np.isnan(point).all()
        return
    both = np.linalg.norm(circle - tx[:2], axis=-1) + np.linalg.norm(circle - rx[:2], axis=-1)
    shortest = circle[lit][np.argmin(both[lit])]
    assert point[0, :2] == pytest.approx(shortest, abs=2 * np.pi / 20000 * radius.item())
    before, after = point[0] - tx, rx - point[0]
    turn = after / np.linalg.norm(after) - before / np.linalg.norm(before)
    assert np.linalg.norm(np.cross(turn, normal[0])) < 1e-9


def test_a_pole_between_the_antennas_or_around_one_reflects_nothing():
    point, _ = pole_reflections(np.array([-5.0, 0, 1]), np.array([5.0, 0, 1]), np.zeros((1, 2)), np.array([0.3]))
    assert np.isnan(point).all()
    point, _ = pole_reflections(np.array([0.1, 0, 1]), np.array([5.0, 0, 1]), np.zeros((1, 2)), np.array([0.3]))
    assert np.isnan(point).all()


@pytest.mark.parametrize("seed", range(20))
def test_the_wave_behind_a_pole_spreads_as_a_tube_of_rays_does(seed):
    tx, rx, centre, radius = random_pole(seed)
    point, normal = pole_reflections(tx, rx, centre, radius)
    if np.isnan(point).any():
        # the pole stands between the antennas or around one, which the test before this one is about
        pytest.skip("no bounce in this draw")
    first = point[0] - tx
    s1, s2 = np.linalg.norm(first), np.linalg.norm(rx - point[0])

    def landing(direction: np.ndarray) -> np.ndarray:
        """Where a ray is s1 + s2 from the transmitter, reflected by the cylinder on the way."""
        to, d = tx[:2] - centre[0], direction[:2]
        a, b, e = d @ d, to @ d, to @ to - radius.item() ** 2
        run = (-b - np.sqrt(b**2 - a * e)) / a
        hit = tx + run * direction
        n = np.append((hit[:2] - centre[0]) / radius.item(), 0.0)
        return hit + (s1 + s2 - run) * (direction - 2 * (direction @ n) * n)

    ray = first / s1
    side = np.cross(ray, [0, 0, 1])
    side /= np.linalg.norm(side)
    other = np.cross(side, ray)
    # small against the angle left to grazing as the ray walks round the pole: radius cos^2 / s1, 1e-4 of it
    step = 1e-4 * radius.item() * (ray @ normal[0]) ** 2 / s1

    def derivative(tangent: np.ndarray) -> np.ndarray:
        ends = [landing(np.cos(step) * ray + sign * np.sin(step) * tangent) for sign in (1, -1)]
        return (ends[0] - ends[1]) / (2 * step)

    area = np.linalg.norm(np.cross(derivative(side), derivative(other)))
    assert pole_spreading(tx, rx, point, normal, radius).item() == pytest.approx(np.sqrt(area), rel=1e-4)


def test_a_pole_of_endless_radius_is_a_wall():
    tx, rx = np.array([5.0, -8.0, 2.0]), np.array([9.0, 12.0, 7.0])
    pole = Environment.empty().with_poles([[-1e9, 0.0]], 1e9, material="glass")
    wall = Environment.walls([[[0.0, -50.0], [0.0, 50.0]]], material="glass")
    round_, flat = (trace(place, tx, rx, FREQUENCY).isel(path=1) for place in (pole, wall))
    assert round_.path_gain.item() == pytest.approx(flat.path_gain.item(), abs=1e-6)
    # coordinates of 1e9 m round to 1e-7 m
    assert round_.vertices.values[0] == pytest.approx(flat.vertices.values[0], abs=1e-6)


def test_a_pole_is_a_reflector_of_its_height_that_walls_can_hide():
    tx, rx = np.array([-10.0, 0.0, 3.0]), np.array([10.0, 0.0, 3.0])

    def orders(place: Environment) -> list[int]:
        return trace(place, tx, rx, FREQUENCY).order.values.tolist()

    assert orders(Environment.empty().with_poles([[0.0, 5.0]], 0.2)) == [0, 1]
    assert orders(Environment.empty().with_poles([[0.0, 5.0]], 0.2, top=2.9)) == [0]
    assert orders(Environment.walls([[[-5.0, 1.0], [-4.0, 4.0]]]).with_poles([[0.0, 5.0]], 0.2)) == [0]
    found = trace(Environment.walls([[[0, 90], [1, 90]]]).with_poles([[0.0, 5.0]], 0.2), tx, rx, FREQUENCY)
    assert found.reflector.values[1].tolist() == [1, -3, -3]
