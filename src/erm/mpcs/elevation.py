"""Elevations that geometry tells where a scan cannot, and what gains are measured given them.

A horn that looks past a path measures how far down its lobe the path arrives only if it knows the elevation. Elevation
and gain of what arrives beyond the fan of a scan are thus uncertain together: whoever learns the one knows the other.
"""

from typing import TYPE_CHECKING

import numpy as np

from erm.geometry.vertical import FloatArray
from erm.mpcs.table import free_space_gain, path_length

if TYPE_CHECKING:
    import xarray as xr

ALLOWED = 3.0  # standard errors; what is further off did not arrive from there
LOBE = 0.1  # of the step in dB; a beamwidth that is wrong by 5 % makes as much


def of_vertical_faces(table: "xr.Dataset") -> FloatArray:
    """Elevation (mpc,) of paths that met vertical faces only, or none: ``sin e = (z_tx - z_rx) / L`` [degree]."""
    climb = table["tx_position"].values[:, 2] - table["rx_position"].values[:, 2]
    return np.asarray(np.rad2deg(np.arcsin(np.clip(climb / path_length(table), -1, 1))))


def off_the_ground(table: "xr.Dataset", ground_height: float = 0.0) -> FloatArray:
    """Elevation (mpc,) of paths that met the ground once, and else vertical faces only [degree].

    ``sin e = -(z_tx + z_rx - 2 z_ground) / L``: their image is as far under the ground as the transmitter is over it.
    """
    climb = table["tx_position"].values[:, 2] + table["rx_position"].values[:, 2] - 2 * ground_height
    return np.asarray(-np.rad2deg(np.arcsin(np.clip(climb / path_length(table), -1, 1))))


def implied_gain(table: "xr.Dataset", ground_height: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Path gains given the elevation that each path's own length and the antennas' heights imply.

    Without a ceiling its image is as high as the transmitter, or as far below the ground. Of the two elevations that is
    taken which is fewer standard errors from the measured one and makes no path stronger than free space.

    Parameters
    ----------
    table : xarray.Dataset
        MPC table (`erm.mpcs.table`).
    ground_height : float
        [m].

    Returns
    -------
    gain, std : array (mpc,)
        [dB], as measured where neither is possible; see `gain_given`.
    """
    free = free_space_gain(path_length(table), table["frequency"].values)
    best = np.full(table.sizes["mpc"], np.inf)
    gain, std = table["path_gain"].values.copy(), table["path_gain_std"].values.copy()
    for elevation in (of_vertical_faces(table), off_the_ground(table, ground_height)):
        given, left = gain_given(table, elevation)
        with np.errstate(invalid="ignore", divide="ignore"):
            away = np.abs(elevation - table["elevation"].values) / table["elevation_std"].values
        better = (away < best) & ~(given - ALLOWED * left > free)
        gain[better], std[better], best[better] = given[better], left[better], away[better]
    return gain, std


def gain_given(table: "xr.Dataset", elevation: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Path gains as they are measured if the paths are known to arrive at an elevation.

    With ``d`` what the elevation is above the measured one, the gain is ``P + p d + q d**2 / 2``, with the slope ``p``
    and the curvature ``q`` that the antenna has there. The error of the elevation drops out of that of the gain, and
    the antenna's comes in.

    Parameters
    ----------
    table : xarray.Dataset
        MPC table (`erm.mpcs.table`).
    elevation : array (mpc,)
        [degree].

    Returns
    -------
    gain, std : array (mpc,)
        [dB]. Those of the table where it has no slope, or says that the path did not arrive there.
    """
    gain, std, doubt, slope, curvature = (
        table[name].values for name in ("path_gain", "path_gain_std", "elevation_std", "gain_slope", "gain_curvature")
    )
    above = elevation - table["elevation"].values
    step = slope * above + curvature * above**2 / 2
    with np.errstate(invalid="ignore"):
        known = np.isfinite(step) & (np.abs(above) <= ALLOWED * doubt)
        away = np.where(above < 0, -doubt, doubt)
        by_elevation = slope * away + curvature * away**2 / 2
        left = np.sqrt(np.maximum(std**2 - by_elevation**2, 0.0) + (LOBE * step) ** 2)
    return np.where(known, gain + step, gain), np.where(known, left, std)
