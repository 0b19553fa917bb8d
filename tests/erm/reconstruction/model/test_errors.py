"""Walls are as good as their covariance says, and near ones stay apart."""

import numpy as np
import pytest

from erm.geometry.vertical import angle_difference, unit
from erm.mpcs.selection import select
from erm.reconstruction.model.fit import fit_line
from erm.reconstruction.model.line import seed_line
from erm.reconstruction.reconstruct import reconstruct

from ..bounces import TX, WALLS, bounces, joined, paths_of, route, scene, sorted_lines


def test_the_wall_of_one_path_is_its_face_with_the_same_covariance():
    rx = route()
    tx = np.tile(TX[0], (len(rx), 1))
    for row in range(len(rx)):
        path = paths_of(bounces(tx, rx, WALLS[1])).take(np.array([row]))
        face = seed_line(path)
        fitted = fit_line(path, face).with_pivot(face.pivot)
        assert float(angle_difference(fitted.normal, face.normal)) == pytest.approx(0, abs=1e-9)
        assert fitted.offset == pytest.approx(face.offset, abs=1e-9)
        np.testing.assert_allclose(fitted.covariance, face.covariance, rtol=1e-6)


@pytest.mark.slow
def test_errors_of_walls_follow_their_covariance():
    delay_std, azimuth_std, draws = 2e-10, 0.5, 40
    chi2 = []
    for seed in range(draws):
        noisy = scene(WALLS[:1], TX[:1], route(6), delay_std, azimuth_std, seed)
        noisy["delay_std"][:], noisy["azimuth_std"][:] = delay_std, azimuth_std
        environment, _ = reconstruct(select(noisy), max_gap=np.inf)
        wall = environment.reflectors.isel(reflector=0)
        error = np.array([angle_difference(wall["normal"], WALLS[0, 0]), wall["offset"] - WALLS[0, 1]])
        chi2.append(error @ np.linalg.solve(wall["covariance"].values, error))
    # the mean of 40 chi-squared values of 2 degrees of freedom is 2 +- 0.32
    assert abs(np.mean(chi2) - 2) < 3 * 0.32


def test_azimuths_left_on_a_ten_degree_grid_still_give_the_walls():
    table = scene(txs=TX[:1], rxs=route(24))
    table["azimuth"][:] = np.round(table["azimuth"].values / 10) * 10
    environment, _ = reconstruct(select(table), max_gap=np.inf)
    found = sorted_lines(environment)
    expected = WALLS[np.argsort(WALLS[:, 0])]
    assert found.shape == expected.shape
    # delays are exact and stand for 0.3 ns; the line near the bounces follows these, not the azimuths
    table = environment.reflectors
    nearest = [np.argmin(np.abs(angle_difference(WALLS[:, 0], normal))) for normal in table["normal"].values]
    middle = table["end_points"].values.mean(axis=1)
    off = np.sum(unit(WALLS[nearest, 0]) * middle, axis=-1) - WALLS[nearest, 1]
    assert np.abs(off).max() < 0.3


def test_parallel_walls_three_metres_apart_stay_two():
    rx = route(24)
    tx = np.tile(TX[0], (len(rx), 1))
    near = rx[:, 0] < 35  # the further wall stands beside the nearer one, not behind it
    parts = [bounces(tx[near], rx[near], (90.0, -50.38)), bounces(tx[~near], rx[~near], (90.0, -53.38))]
    environment, _ = reconstruct(select(joined(parts, 1e-10, 1.0)), max_gap=np.inf)
    found = sorted_lines(environment)
    assert len(found) == 2
    np.testing.assert_allclose(np.sort(found[:, 1]), [-53.38, -50.38], atol=0.5)


@pytest.mark.slow
def test_faces_half_a_metre_apart_are_told_apart():
    rx = route(24)
    tx = np.tile(TX[0], (len(rx), 1))
    near = rx[:, 0] < np.median(rx[:, 0])  # one after the other: faces that alternate are parts of one facade
    parts = [bounces(tx[near], rx[near], (90.0, -20.0)), bounces(tx[~near], rx[~near], (90.0, -20.5))]
    environment, _ = reconstruct(select(joined(parts, 1e-10, 0.5)), max_gap=np.inf)
    offsets = np.unique(environment.reflectors["offset"].values)
    # 3 cm of path are 2 cm of offset, less by the averaging
    np.testing.assert_allclose(offsets, [-20.5, -20.0], atol=0.1)
