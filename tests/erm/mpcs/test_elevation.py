"""Whoever learns a path's elevation learns how far down the horn's lobe it arrived, and so how strong it is."""

import numpy as np

from erm.common.constants import c
from erm.mpcs.elevation import gain_at_elevation, ground_reflection_elevation, implied_gain, vertical_face_elevation
from erm.mpcs.files import read_csv, write_mpcs
from erm.mpcs.selection import select
from erm.mpcs.table import make_table

WIDTH, EDGE = 9.0, 9.0  # degree: half-power beamwidth, and the highest beam of the scan
TX, RX = np.array([0.0, 0.0, 28.4]), np.array([60.0, 10.0, 1.4])
LENGTH = np.linspace(75.0, 130.0, 12)
TRUE = np.rad2deg(np.arcsin((TX[2] - RX[2]) / LENGTH))  # 12 to 21 degrees


def lobe(elevation):
    """Gain of the edge beam, a Gaussian lobe [dB]."""
    return -12.0 * ((elevation - EDGE) / WIDTH) ** 2


def table(measured, std):
    """Paths of -110 dB taken to arrive at an elevation: what the edge beam received is the same."""
    gain = -110.0 + lobe(TRUE) - lobe(measured)
    ends = {"position": "RX1", "tx_position": TX, "rx_position": RX, "frequency": 132e9}
    lobes = {"gain_slope": 24 / WIDTH**2 * (measured - EDGE), "gain_curvature": 24 / WIDTH**2}
    errors = {"elevation_std": std, "path_gain_std": np.abs(lobe(measured + std) - lobe(measured)), "delay_std": 1e-12}
    values = {"delay": LENGTH / c, "azimuth": 90.0, "azimuth_std": 0.1, "elevation": measured, "path_gain": gain}
    return make_table(ends | lobes | errors | values)


def test_the_gain_of_a_path_beyond_the_fan_is_what_it_is_once_its_elevation_is_known():
    mpcs = table(np.full_like(TRUE, 10.0), 7.0)
    assert np.abs(mpcs["path_gain"].values + 110).max() > 10  # as measured
    np.testing.assert_allclose(vertical_face_elevation(mpcs), TRUE)
    gain, std = gain_at_elevation(mpcs, vertical_face_elevation(mpcs))
    known = TRUE - 10.0 < 3 * 7.0
    np.testing.assert_allclose(gain[known], -110.0)
    assert (std < mpcs["path_gain_std"].values).all()


def test_a_path_that_is_known_to_arrive_elsewhere_keeps_its_gain():
    mpcs = table(np.full_like(TRUE, 10.0), 0.2)
    gain, std = gain_at_elevation(mpcs, vertical_face_elevation(mpcs))
    np.testing.assert_array_equal(gain, mpcs["path_gain"])
    np.testing.assert_array_equal(std, mpcs["path_gain_std"])


def test_heights_imply_the_gain_of_paths_off_walls():
    mpcs = table(np.full_like(TRUE, 10.0), 7.0)
    mpcs["path_gain"][:] = mpcs["path_gain"].values - 20.0  # over 100 m free space allows -115 dB
    gain, std = implied_gain(mpcs)
    np.testing.assert_allclose(gain, -130.0)
    assert (std < mpcs["path_gain_std"].values).all()


def test_a_path_off_the_ground_does_not_get_the_gain_of_one_off_a_wall():
    # it arrives from as far below the horizon as (28.4 + 1.4) / L, and was seen at the fan's lower edge
    below = np.rad2deg(np.arcsin(-(TX[2] + RX[2]) / LENGTH))
    np.testing.assert_allclose(ground_reflection_elevation(table(TRUE, 1.0)), below)
    mpcs = table(np.full_like(TRUE, -10.0), 9.0)
    lower = -12.0 * ((below + EDGE) / WIDTH) ** 2 + 12.0 * ((-10.0 + EDGE) / WIDTH) ** 2
    mpcs["path_gain"][:] = -130.0 + lower
    mpcs["gain_slope"][:] = 24 / WIDTH**2 * (-10.0 + EDGE)
    gain, _ = implied_gain(mpcs)
    np.testing.assert_allclose(gain, -130.0)
    as_off_a_wall, _ = gain_at_elevation(mpcs, vertical_face_elevation(mpcs))
    assert (as_off_a_wall[TRUE - mpcs["elevation"].values < 3 * 9.0] > -90).all()  # stronger than free space allows


def test_an_elevation_that_makes_a_path_stronger_than_free_space_is_not_implied():
    # nearer by its error to that of a vertical face, where it would be 8 dB over free space and more
    mpcs = table(np.full_like(TRUE, 2.0), 12.0)
    free = 20 * np.log10(c / 132e9 / (4 * np.pi * LENGTH))
    mpcs["path_gain"][:] = free - 12.0
    mpcs["path_gain_std"][:] = 1.0
    mpcs["gain_slope"][:] = 2.0
    mpcs["gain_curvature"][:] = 0.0
    gain, std = implied_gain(mpcs)
    assert (gain < free + 3 * std).all()


def test_a_table_without_slopes_keeps_its_gains():
    mpcs = table(np.full_like(TRUE, 10.0), 7.0).drop_vars(["gain_slope", "gain_curvature"])
    mpcs = mpcs.assign(gain_slope=("mpc", np.full(12, np.nan)), gain_curvature=("mpc", np.full(12, np.nan)))
    gain, std = gain_at_elevation(mpcs, vertical_face_elevation(mpcs))
    np.testing.assert_array_equal(gain, mpcs["path_gain"])
    np.testing.assert_array_equal(std, mpcs["path_gain_std"])


def test_losses_of_walls_are_those_at_the_elevation_of_vertical_faces():
    mpcs = table(np.full_like(TRUE, 10.0), 7.0)
    free = 20 * np.log10(c / 132e9 / (4 * np.pi * LENGTH))
    np.testing.assert_allclose(select(mpcs)["reflection_loss"], free + 110.0)
    # the letter's method takes gains as they are
    as_measured = select(mpcs, threshold="letter")["reflection_loss"]
    np.testing.assert_allclose(as_measured, free - mpcs["path_gain"].values)


def test_slopes_survive_a_file(tmp_path):
    mpcs = table(np.full_like(TRUE, 10.0), 7.0)
    write_mpcs(mpcs, tmp_path / "mpcs.csv")
    again, complaints = read_csv(tmp_path / "mpcs.csv")
    assert not complaints
    for name in ("gain_slope", "gain_curvature"):
        np.testing.assert_array_equal(again[name], mpcs[name])
    assert "wrap_period" not in (tmp_path / "mpcs.csv").read_text().splitlines()[0]
