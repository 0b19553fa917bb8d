"""The closed forms against drawn mirrors, finite differences, random draws and an independent ray tracer."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.constants import c

from erm.geometry.vertical import (
    angle_difference,
    azimuth_of,
    bounce_height,
    face_line,
    horizontal_length,
    mirrored,
    reflection_point,
    unit,
    virtual_anchor,
)
from erm.geometry.vertical_covariance import line_covariance, point_covariance


def mirror_scene(seed, n=400):
    """Random antennas on the n-side of random walls, and the exact length and azimuth of the path."""
    rng = np.random.default_rng(seed)
    normal = rng.uniform(0, 360, n)
    offset = rng.uniform(-80, 80, n)
    along, up = unit(normal + 90), unit(normal)

    def antenna(height):
        in_front = offset + rng.uniform(2, 90, n)
        xy = along * rng.uniform(-100, 100, n)[:, None] + up * in_front[:, None]
        return np.column_stack([xy, rng.uniform(*height, n)])

    tx, rx = antenna((5, 40)), antenna((1, 3))
    image = mirrored(tx, normal, offset)
    seen = image - rx[:, :2]
    length = np.hypot(np.linalg.norm(seen, axis=-1), tx[:, 2] - rx[:, 2])
    return tx, rx, length, azimuth_of(seen), normal, offset, image


def test_the_mirror_image_the_face_and_the_reflection_point_are_found():
    tx, rx, length, azimuth, normal, offset, image = mirror_scene(1)
    point, found = reflection_point(tx, rx, length, azimuth)
    # lengths to 250 m: cancellation in L**2 - dz**2 leaves about 250 * 1e-16 * 1e3 m
    np.testing.assert_allclose(virtual_anchor(tx, rx, length, azimuth), image, atol=1e-9)
    np.testing.assert_allclose(angle_difference(found, normal), 0, atol=1e-9)
    np.testing.assert_allclose(np.sum(unit(normal) * point, axis=-1), offset, atol=1e-8)
    line_normal, line_offset = face_line(tx, rx, length, azimuth)
    np.testing.assert_allclose(angle_difference(line_normal, normal), 0, atol=1e-9)
    np.testing.assert_allclose(line_offset, offset, atol=1e-8)


def test_the_two_legs_add_up_and_obey_snells_law():
    tx, rx, length, azimuth, normal, *_ = mirror_scene(2)
    point, _ = reflection_point(tx, rx, length, azimuth)
    bounce = np.column_stack([point, bounce_height(tx, rx, length, azimuth)])
    away, back = bounce - tx, rx - bounce
    legs = np.linalg.norm(away, axis=-1) + np.linalg.norm(back, axis=-1)
    np.testing.assert_allclose(legs, length, rtol=1e-12)
    n = np.column_stack([unit(normal), np.zeros(len(normal))])
    slope_in = np.sum(away * n, axis=-1) / np.linalg.norm(away, axis=-1)
    slope_out = np.sum(back * n, axis=-1) / np.linalg.norm(back, axis=-1)
    np.testing.assert_allclose(slope_in, -slope_out, atol=1e-9)


def test_planar_equations_agree_with_the_exact_ones_for_antennas_of_equal_height():
    tx, rx, length, azimuth, *_ = mirror_scene(3)
    exact = reflection_point(tx[:, :2], rx[:, :2], length, azimuth)
    same_height = np.column_stack([tx[:, :2], rx[:, 2]])
    np.testing.assert_array_equal(reflection_point(same_height, rx, length, azimuth, planar=True)[0], exact[0])
    np.testing.assert_array_equal(reflection_point(same_height, rx, length, azimuth)[0], exact[0])


@pytest.mark.parametrize("ratio", [1 + 1e-14, 1.0, 0.99, 0.0, -2.0, np.nan])
def test_a_path_no_longer_than_the_direct_one_has_no_face(ratio):
    tx, rx = np.array([3.0, -4.0, 12.0]), np.array([10.0, 8.0, 1.5])
    length = ratio * np.linalg.norm(tx - rx)
    assert np.isnan(horizontal_length(tx, rx, length))
    point, normal = reflection_point(tx, rx, length, azimuth_of(tx - rx))
    assert np.isnan(point).all()
    assert np.isnan(normal)


def test_shapes_broadcast():
    tx, rx = np.array([0.0, 0.0, 20.0]), np.ones((5, 1, 3))
    point, normal = reflection_point(tx, rx, 100.0, np.zeros(7))
    assert point.shape == (5, 7, 2)
    assert normal.shape == (5, 7)
    assert line_covariance(tx, rx, 100.0, np.zeros(7), 0.1, 1.0).shape == (5, 7, 2, 2)


@pytest.mark.parametrize("quantity", ["point", "line"])
def test_covariances_are_those_of_finite_differences(quantity):
    tx, rx, length, azimuth, *_ = mirror_scene(4)
    length_std, azimuth_std = 0.04, 0.7

    def value(length, azimuth):
        if quantity == "point":
            path = tx, rx, length, azimuth
            return np.column_stack([reflection_point(*path)[0], bounce_height(*path)])
        return np.stack(face_line(tx, rx, length, azimuth), axis=-1)

    def slope(step_length, step_azimuth, step):
        change = value(length + step_length, azimuth + step_azimuth) - value(
            length - step_length, azimuth - step_azimuth
        )
        if quantity == "line":
            change[:, 0] = angle_difference(change[:, 0], 0)
        return change / (2 * step)

    # central differences: truncation ~ step**2 and rounding ~ 1e-12/step both far below 1e-5 of the value
    jacobian = np.stack([slope(1e-4, 0, 1e-4) * length_std, slope(0, 1e-4, 1e-4) * azimuth_std], axis=-1)
    expected = jacobian @ jacobian.swapaxes(-1, -2)
    function = point_covariance if quantity == "point" else line_covariance
    got = function(tx, rx, length, azimuth, length_std, azimuth_std)
    scale = np.abs(expected).max(axis=(1, 2), keepdims=True)
    np.testing.assert_allclose(got / scale, expected / scale, atol=1e-5)


def test_covariances_are_those_of_random_draws():
    tx, rx, length, azimuth, *_ = (value[:20] for value in mirror_scene(5))
    rng = np.random.default_rng(6)
    draws = 20_000
    noisy_length = length[:, None] + 0.01 * rng.standard_normal((20, draws))
    noisy_azimuth = azimuth[:, None] + 0.02 * rng.standard_normal((20, draws))
    point, _ = reflection_point(tx[:, None], rx[:, None], noisy_length, noisy_azimuth)
    expected = point_covariance(tx, rx, length, azimuth, 0.01, 0.02)[:, :2, :2]
    for drawn, covariance in zip(point, expected, strict=True):
        whitened = np.linalg.solve(np.linalg.cholesky(covariance), (drawn - drawn.mean(axis=0)).T)
        # a sample covariance of n draws deviates by about sqrt(2/n) = 0.01; five of these
        np.testing.assert_allclose(np.cov(whitened), np.eye(2), atol=0.05)


def test_an_azimuth_error_moves_the_point_along_the_face():
    tx, rx, length, azimuth, normal, *_ = mirror_scene(7)
    covariance = point_covariance(tx, rx, length, azimuth, 0.0, 1.0)
    n = np.column_stack([unit(normal), np.zeros(len(normal))])
    across = np.einsum("ni,nij,nj->n", n, covariance, n)
    assert np.all(across < 1e-18 * length**2)


@pytest.mark.parametrize("scene", ["lroom", "canyon", "city"])
@pytest.mark.parametrize("kind", ["specular", "diffuse"])
def test_reflections_of_an_independent_ray_tracer_are_located_within_a_millimetre(shared_data: Path, scene, kind):
    with h5py.File(shared_data / "raytraced" / f"{scene}_{kind}.h5") as file:
        path = file["path"]
        wanted = path["is_single_bounce_specular_wall"][:]
        tx = file["tx_position"][:]
        rx = file["rx_position"][:][path["rx_index"][:][wanted]]
        length = path["delay_geom_s"][:][wanted] * c
        azimuth = np.rad2deg(path["aoa_az"][:][wanted])
        truth = path["last_vertex"][:][wanted]
    assert len(truth) > 10
    point, _ = reflection_point(tx, rx, length, azimuth)
    height = bounce_height(tx, rx, length, azimuth)
    assert np.linalg.norm(point - truth[:, :2], axis=-1).max() < 1e-3
    assert np.abs(height - truth[:, 2]).max() < 1e-3
