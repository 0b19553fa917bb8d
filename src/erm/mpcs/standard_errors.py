"""How large the errors of delays and angles are, where a table does not say.

The direct path is a measurement of something known, so its errors can be read off. Where none was received the
residuals of paths off common walls tell the same, once there are walls.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from erm.common.constants import c
from erm.geometry.vertical import FloatArray, angle_difference, azimuth_of

if TYPE_CHECKING:
    import xarray as xr

DELAY_STD = 0.3e-9  # s; a sample of a 1.2 GS/s sounder is 0.83 ns, 0.24 ns rms when delays are left on it
AZIMUTH_STD = 3.0  # degree; a 10 degree grid left unrefined is 2.9 degrees rms
ELEVATION_STD = 3.0  # degree
GAIN_STD = 0.0  # dB; not looked for, the losses of one wall scatter by more
LEAST = (1e-12, 1e-2, 1e-2)  # s, degree, degree; 0.3 mm, and 2 mm at 10 m: below, survey and arithmetic rule
SHARES = (0.0, 0.1, 0.3, 1.0, 3.0, 10.0)  # of a common error in the typical one
NORMAL = 1.4826  # standard deviations of a Gaussian in its median absolute deviation
EVIDENCE = 2.0  # log odds of wider errors against what the table says; Akaike, for two parameters
EXACT = 1e-3  # of the standard errors; residuals without any error tell no scale
FEWEST = 5  # direct paths or residuals that make an estimate


class Noise(NamedTuple):
    """Standard errors of a table without any, and where they are from."""

    delay: float  # s
    azimuth: float  # degree
    elevation: float  # degree
    sample: int  # errors behind them
    source: str


ASSUMED = Noise(DELAY_STD, AZIMUTH_STD, ELEVATION_STD, 0, "an assumption")


def of_direct_paths(table: "xr.Dataset") -> Noise:
    """Errors of the components that are nearest to the direct path of their link.

    One a link is looked at, the strongest within three assumed standard errors of where the direct path must be;
    the scale is the median absolute deviation from that, so that links where something else arrives there do not
    count. `ASSUMED` where fewer than ``FEWEST`` links have one.
    """
    apart = table["tx_position"].values - table["rx_position"].values
    late = table["delay"].values - np.linalg.norm(apart, axis=-1) / c
    aside = angle_difference(table["azimuth"].values, azimuth_of(apart))
    climb = np.rad2deg(np.arctan2(apart[:, 2], np.hypot(apart[:, 0], apart[:, 1])))
    above = table["elevation"].values - climb
    near = np.flatnonzero((np.abs(late) < 3 * DELAY_STD) & (np.abs(aside) < 3 * AZIMUTH_STD))
    near = near[np.argsort(-table["path_gain"].values[near], kind="stable")]
    ends = np.hstack([table["tx_position"].values[near], table["rx_position"].values[near]])
    _, strongest = np.unique(ends, axis=0, return_index=True)
    rows = near[strongest]
    if len(rows) < FEWEST:
        return ASSUMED
    seen = np.isfinite(above[rows])
    climbing = scale(above[rows][seen]) if np.count_nonzero(seen) >= FEWEST else ELEVATION_STD
    found = (scale(late[rows]), scale(aside[rows]), climbing)
    delay, azimuth, elevation = (max(value, least) for value, least in zip(found, LEAST, strict=True))
    return Noise(delay, azimuth, elevation, len(rows), "direct paths")


def widened(residual: FloatArray, of: FloatArray, std: FloatArray) -> FloatArray:
    """Standard errors widened to what residuals show.

    Errors that a table underrates may be in proportion to what it says, as those of paths that others disturb, or the
    same for all, as those of a survey. Of ``f * hypot(std, share * median(std))`` for some shares, with ``f`` the scale
    of the residuals, the one is taken under which these are likeliest (Student's t of 3 degrees of freedom). What the
    table says holds unless that is likelier by a factor ``exp(EVIDENCE)``: few residuals are large by chance.

    Parameters
    ----------
    residual, of : array (residual,)
        Residuals and the standard errors they should have.
    std : array (path,)
        Standard errors to widen.
    """
    typical = float(np.median(of))
    best, likeliest = std, _likelihood(residual, of) + EVIDENCE
    for share in SHARES:
        own = np.hypot(of, share * typical)
        factor = max(scale(residual / own), EXACT)
        likelihood = _likelihood(residual, factor * own)
        if likelihood > likeliest:
            best, likeliest = np.maximum(std, factor * np.hypot(std, share * typical)), likelihood
    return best


def _likelihood(residual: FloatArray, std: FloatArray) -> float:
    """Logarithm, but for a constant, of Student's t of 3 degrees of freedom."""
    return -float(np.sum(np.log(std) + 2 * np.log1p((residual / std) ** 2 / 3)))


def scale(errors: FloatArray) -> float:
    """Standard deviation of errors about zero, of which up to half may be anything."""
    return NORMAL * float(np.median(np.abs(errors)))
