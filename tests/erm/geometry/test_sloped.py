"""Faces of any slope against drawn mirrors, finite differences, vertical faces and an independent ray tracer."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.constants import c

from erm.geometry.sloped import sloped_covariance, sloped_face
from erm.geometry.vertical import angle_difference, azimuth_of, bounce_height, reflection_point
from erm.geometry.vertical_covariance import point_covariance
from erm.mpcs.selection import select
from erm.mpcs.table import make_table


def elevation_of(vector):
    return np.rad2deg(np.arctan2(vector[..., 2], np.hypot(vector[..., 0], vector[..., 1])))


def mirror_scene(seed, n=300):
    """Random antennas in front of random planes, and length and arrival of the path."""
    rng = np.random.default_rng(seed)
    normal = rng.standard_normal((n, 3))
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    offset = rng.uniform(-80, 80, n)

    def antenna():
        point = rng.uniform(-60, 60, (n, 3))
        depth = rng.uniform(2, 90, n) + offset - np.sum(normal * point, axis=-1)
        return point + depth[:, None] * normal

    tx, rx = antenna(), antenna()
    image = tx + 2 * (offset - np.sum(normal * tx, axis=-1))[:, None] * normal
    seen = image - rx
    return tx, rx, np.linalg.norm(seen, axis=-1), azimuth_of(seen), elevation_of(seen), normal, offset


def test_the_plane_and_the_reflection_point_are_found():
    *path, normal, offset = mirror_scene(1)
    found = sloped_face(*path)
    np.testing.assert_allclose(found.offset, offset, atol=1e-9)
    np.testing.assert_allclose(found.tilt, elevation_of(normal), atol=1e-9)
    np.testing.assert_allclose(angle_difference(found.normal, azimuth_of(normal)), 0, atol=1e-7)
    np.testing.assert_allclose(np.sum(found.point * normal, axis=-1), offset, atol=1e-9)
    tx, rx, length = path[:3]
    legs = np.linalg.norm(found.point - tx, axis=-1) + np.linalg.norm(rx - found.point, axis=-1)
    np.testing.assert_allclose(legs, length, rtol=1e-12)


def test_both_forms_agree_on_a_vertical_face():
    rng = np.random.default_rng(2)
    tx, rx = np.array([3.0, -2.0, 28.4]), np.column_stack([rng.uniform(20, 80, (50, 2)), np.full(50, 1.4)])
    length = np.linalg.norm(tx - rx, axis=-1) + rng.uniform(5, 90, 50)
    azimuth, elevation = rng.uniform(0, 360, 50), np.rad2deg(np.arcsin(27.0 / length))
    found = sloped_face(tx, rx, length, azimuth, elevation)
    point, normal = reflection_point(tx, rx, length, azimuth)
    np.testing.assert_allclose(found.point[:, :2], point, atol=1e-9)
    np.testing.assert_allclose(found.point[:, 2], bounce_height(tx, rx, length, azimuth), atol=1e-9)
    np.testing.assert_allclose(angle_difference(found.normal, normal), 0, atol=1e-9)
    np.testing.assert_allclose(found.tilt, 0, atol=1e-9)


def test_the_normal_of_the_ground_points_up_and_that_of_a_ceiling_down():
    tx, rx = np.array([0.0, 0.0, 4.0]), np.array([30.0, 10.0, 2.0])
    for plane, tilt in ((0.0, 90.0), (5.0, -90.0)):
        seen = np.array([0.0, 0.0, 2 * plane - 4.0]) - rx
        found = sloped_face(tx, rx, np.linalg.norm(seen), azimuth_of(seen), elevation_of(seen))
        assert found.tilt == pytest.approx(tilt, abs=1e-6)
        assert found.point[2] == pytest.approx(plane, abs=1e-9)


def test_covariances_are_those_of_finite_differences():
    tx, rx, *measured, normal, _ = mirror_scene(3)
    spread = np.random.default_rng(4).standard_normal((3, 3)) * [[0.05], [0.7], [0.9]]
    covariance = spread @ spread.T  # of length, azimuth, elevation; correlated

    def changes(value):
        slopes = []
        for number, step in enumerate((1e-4, 1e-4, 1e-4)):
            ends = []
            for sign in (1, -1):
                moved = [one + sign * step * (number == k) for k, one in enumerate(measured)]
                ends.append(value(sloped_face(tx, rx, *moved)))
            slopes.append((ends[0] - ends[1]) / (2 * step))
        return np.stack(slopes, axis=-1)

    def face(found):
        return np.stack([angle_difference(found.normal, azimuth_of(normal)), found.tilt, found.offset], axis=-1)

    got = sloped_covariance(tx, rx, *measured, covariance)
    for mine, value in zip(got, (lambda found: found.point, face), strict=True):
        jacobian = changes(value)
        expected = jacobian @ covariance @ jacobian.swapaxes(-1, -2)
        scale = np.sqrt(np.einsum("nii->ni", expected))
        scale = scale[:, :, None] * scale[:, None, :]
        # central differences of 1e-4: truncation and rounding are some 1e-7 of values of order one
        np.testing.assert_allclose(mine / scale, expected / scale, atol=1e-5)


def test_with_an_exact_elevation_the_errors_are_those_of_a_vertical_face():
    tx, rx = np.array([0.0, 0.0, 10.0]), np.array([40.0, 5.0, 10.0])  # equal heights: both forms agree
    length, azimuth = 70.0, 120.0
    both = sloped_covariance(tx, rx, length, azimuth, 0.0, np.diag([0.1**2, 1.0**2, 0.0]))[0]
    np.testing.assert_allclose(both, point_covariance(tx, rx, length, azimuth, 0.1, 1.0), atol=1e-12)


@pytest.mark.parametrize("ratio", [1 + 1e-14, 1.0, 0.9, -1.0, np.nan])
def test_a_path_no_longer_than_the_direct_one_has_no_face(ratio):
    tx, rx = np.array([3.0, -4.0, 12.0]), np.array([10.0, 8.0, 1.5])
    length = ratio * np.linalg.norm(tx - rx)
    found = sloped_face(tx, rx, length, azimuth_of(tx - rx), elevation_of(tx - rx))
    assert all(np.isnan(value).all() for value in found)
    for covariance in sloped_covariance(tx, rx, length, 0.0, 0.0, np.eye(3)):
        assert np.isnan(covariance).all()


def test_selected_mpcs_have_the_tilt_of_their_faces_and_a_mark_of_grazing():
    tx, rx = np.array([0.0, 0.0, 20.0]), np.array([50.0, 0.0, 1.5])
    direct = np.linalg.norm(tx - rx)
    wall, ground = direct + 25.0, np.hypot(50.0, 21.5)
    length = np.array([wall, ground, direct + 0.05, wall])
    elevation = [np.rad2deg(np.arcsin(18.5 / wall)), np.rad2deg(np.arcsin(-21.5 / ground)), 5.0, np.nan]
    ends = {"position": "RX", "tx_position": tx, "rx_position": rx, "frequency": 132e9, "path_gain": -120.0}
    errors = {"delay_std": 1e-10, "azimuth_std": 0.5, "elevation_std": 0.5, "path_gain_std": 1.0}
    azimuth = np.array([100.0, 180.0, 170.0, 100.0])
    found = select(make_table(ends | errors | {"delay": length / c, "azimuth": azimuth, "elevation": elevation}))
    np.testing.assert_allclose(found["tilt"].values[:2], [0, 90], atol=1e-6)
    assert np.isnan(found["tilt"].values[3])
    assert (found["tilt_std"].values[:2] > 0.2).all()
    assert (found["tilt_std"].values[:2] < 2).all()
    np.testing.assert_array_equal(found["grazing"], [False, False, True, False])  # 5 cm are 1.7 of 3 cm


@pytest.mark.parametrize("scene", ["lroom", "canyon", "city"])
def test_diffuse_reflections_of_an_independent_ray_tracer_are_located(shared_data: Path, scene):
    with h5py.File(shared_data / "raytraced" / f"{scene}_diffuse.h5") as file:
        path = file["path"]
        wanted = path["is_single_bounce"][:]
        tx, rx = file["tx_position"][:], file["rx_position"][:][path["rx_index"][:][wanted]]
        length = path["delay_geom_s"][:][wanted] * c
        truth = path["last_vertex"][:][wanted]
    # the tracer's own angles are those of float32 coordinates, a milliradian and more off the vertex
    longer = length > np.linalg.norm(tx - rx, axis=-1) + 0.1  # the others graze
    seen = (truth - rx)[longer]
    assert len(seen) > 1000
    found = sloped_face(tx, rx[longer], length[longer], azimuth_of(seen), elevation_of(seen))
    np.testing.assert_allclose(found.point, truth[longer], atol=1e-6)


@pytest.mark.parametrize("scene", ["lroom", "canyon", "city"])
def test_the_tilts_of_an_independent_ray_tracer_are_found(shared_data: Path, scene):
    with h5py.File(shared_data / "raytraced" / f"{scene}_specular.h5") as file:
        path = file["path"]
        wanted = path["order"][:] == 1
        tx, rx = file["tx_position"][:], file["rx_position"][:][path["rx_index"][:][wanted]]
        length = path["delay_geom_s"][:][wanted] * c
        seen = path["last_vertex"][:][wanted] - rx
        tilt = elevation_of(path["normal"][:][wanted, 0])
    found = sloped_face(tx, rx, length, azimuth_of(seen), elevation_of(seen))
    # the tracer's vertices break the law of reflection by up to 4 mrad
    np.testing.assert_allclose(found.tilt, tilt, atol=0.25)
    assert (np.abs(tilt) > 89).any()
    assert (np.abs(tilt) < 1).any()
