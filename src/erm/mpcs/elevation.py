"""Elevations from geometry, and path gains at these elevations.

An MPC outside the elevations of a scan is received on the side of the antenna's lobe. Its elevation and its gain are
then uncertain together: if the elevation is known from geometry, the gain is known better, too.
"""

from typing import TYPE_CHECKING

import numpy as np

from erm.geometry.vertical import FloatArray
from erm.mpcs.standard_errors import SIGMAS
from erm.mpcs.table import free_space_gain, path_length

if TYPE_CHECKING:
    import xarray as xr

PATTERN_ERROR = 0.1
"""Error of a change of gain, relative to the change in dB: that of a beamwidth that is wrong by 5 %."""


def vertical_face_elevation(table: "xr.Dataset") -> FloatArray:
    """Elevation (mpc,) of direct paths and reflections off vertical faces: ``sin e = (z_tx - z_rx) / L`` [degree]."""
    climb = table["tx_position"].values[:, 2] - table["rx_position"].values[:, 2]
    return np.asarray(np.rad2deg(np.arcsin(np.clip(climb / path_length(table), -1, 1))))


def ground_reflection_elevation(table: "xr.Dataset", ground_height: float = 0.0) -> FloatArray:
    """Elevation (mpc,) of paths with one reflection off the ground and any off vertical faces [degree].

    ``sin e = -(z_tx + z_rx - 2 z_ground) / L``: the image is as far below the ground as the transmitter is above it.
    """
    climb = table["tx_position"].values[:, 2] + table["rx_position"].values[:, 2] - 2 * ground_height
    return np.asarray(-np.rad2deg(np.arcsin(np.clip(climb / path_length(table), -1, 1))))


def implied_gain(table: "xr.Dataset", ground_height: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Path gains at the elevation that path length and antenna heights imply.

    Without a ceiling, the image of the transmitter is at its height, or mirrored in the ground. Of the two elevations
    the one nearest to the measured elevation, in standard errors, is used, if the gain is not above free space.

    Parameters
    ----------
    table : xarray.Dataset
        MPC table (`erm.make_table`).
    ground_height : float
        Height of the ground [m].

    Returns
    -------
    gain, std : array (mpc,)
        Gains and their standard errors [dB]; as measured where neither elevation is possible. See `gain_at_elevation`.
    """
    free = free_space_gain(path_length(table), table["frequency"].values)
    best = np.full(table.sizes["mpc"], np.inf)
    gain, std = table["path_gain"].values.copy(), table["path_gain_std"].values.copy()
    for elevation in (vertical_face_elevation(table), ground_reflection_elevation(table, ground_height)):
        given, given_std = gain_at_elevation(table, elevation)
        with np.errstate(invalid="ignore", divide="ignore"):
            deviation = np.abs(elevation - table["elevation"].values) / table["elevation_std"].values
        better = (deviation < best) & ~(given - SIGMAS * given_std > free)
        gain[better], std[better], best[better] = given[better], given_std[better], deviation[better]
    return gain, std


def gain_at_elevation(table: "xr.Dataset", elevation: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Path gains if the paths arrive at known elevations.

    With ``d`` the known elevation minus the measured one, the gain is ``P + p d + q d**2 / 2``; ``p`` and ``q`` are
    ``gain_slope`` and ``gain_curvature`` of the table. The error of the elevation no longer contributes to that of the
    gain; the error of the antenna pattern does.

    Parameters
    ----------
    table : xarray.Dataset
        MPC table (`erm.make_table`).
    elevation : array (mpc,)
        Known elevations [degree].

    Returns
    -------
    gain, std : array (mpc,)
        Gains and their standard errors [dB]. They are those of the table where it has no slope, or where the known
        elevation deviates from the measured one by more than three standard errors.
    """
    gain, std, elevation_std, slope, curvature = (
        table[name].values for name in ("path_gain", "path_gain_std", "elevation_std", "gain_slope", "gain_curvature")
    )
    difference = elevation - table["elevation"].values
    step = slope * difference + curvature * difference**2 / 2
    with np.errstate(invalid="ignore"):
        known = np.isfinite(step) & (np.abs(difference) <= SIGMAS * elevation_std)
        error = np.where(difference < 0, -elevation_std, elevation_std)
        by_elevation = slope * error + curvature * error**2 / 2
        remaining = np.sqrt(np.maximum(std**2 - by_elevation**2, 0.0) + (PATTERN_ERROR * step) ** 2)
    return np.where(known, gain + step, gain), np.where(known, remaining, std)
