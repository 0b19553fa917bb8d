"""Angles of departure of MPCs, where the transmit antenna was turned or switched between beams too."""

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from sounder.mpc.scan import Scan

Real = NDArray[np.float64]


def with_departures(
    table: xr.Dataset,
    departure: NDArray[np.record],
    located: NDArray[np.bool_],
    scan: Scan,
    inflation: Real,
    pattern: Real,
) -> xr.Dataset:
    """Add the directions in which the paths left the transmit antenna.

    The fit of the departure has the arrival known, and the other way round. Their errors are uncorrelated and each
    those of the Cramer-Rao bound of both; :mod:`sounder.kernels.extraction.fit_path` derives it.

    Parameters
    ----------
    table : xarray.Dataset
        Along ``mpc``.
    departure : array of `sounder.kernels.extraction.records.PATH` (mpc,)
    located : array (mpc,)
        Whether the direction is known.
    scan : Scan
    inflation : array (mpc,)
        Variance of the magnitudes over that which the fit knows of, for other paths.
    pattern : array (mpc, 3, 3)
        Of the transmit antenna, from :func:`sounder.mpc.stated.pattern_covariance`.

    Returns
    -------
    xarray.Dataset
        The table with ``departure_azimuth`` and ``departure_elevation`` [degree], directions from TX toward the first
        interaction, and their ``_std``. NaN where the path is in the main lobe of no beam, and of an angle that the
        transmit antenna was not turned in.
    """
    beams, survey = scan.departure, scan.sounder.survey
    turned = {"azimuth": beams.azimuth.size > 1, "elevation": beams.elevation.size > 1}
    common = {"azimuth": survey.heading_std, "elevation": survey.tilt_std}
    named = {
        "azimuth": "azimuth of departure, counter-clockwise from east",
        "elevation": "elevation of departure above the horizon",
    }
    for place, (axis, long_name) in enumerate(named.items()):
        known = located if turned[axis] else np.zeros(len(departure), bool)
        angle = departure[axis] % 360 if axis == "azimuth" else departure[axis]
        variance = departure[f"{axis}_variance"] * inflation + pattern[:, place, place] + common[axis] ** 2
        std = np.sqrt(np.where(known, variance, np.nan))
        name, units = f"departure_{axis}", {"units": "degree"}
        table[name] = ("mpc", np.where(known, angle, np.nan), units | {"long_name": long_name})
        table[f"{name}_std"] = ("mpc", std, units | {"long_name": f"standard deviation of {axis} of departure"})
    return table
