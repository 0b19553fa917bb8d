"""Clusters: MPCs of one antenna pair that are near to each other in delay and azimuth."""

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from erm.geometry.vertical import angle_difference

if TYPE_CHECKING:
    import xarray as xr

BoolArray = npt.NDArray[np.bool_]


def clusters(
    table: "xr.Dataset", link: npt.NDArray[np.int64], *, delay_window: float, azimuth_window: float
) -> tuple[npt.NDArray[np.int64], BoolArray]:
    """Group the MPCs of each link around the strongest ones.

    The strongest remaining MPC and all others within an ellipse around it in delay and (circular) azimuth become one
    cluster, until none remains. Diffuse tails and sidelobes thus join the specular path that causes them.

    Parameters
    ----------
    table : xarray.Dataset
        MPC table (`erm.make_table`).
    link : array (mpc,) of int
        Antenna pair of each MPC.
    delay_window, azimuth_window : float
        Half axes of the ellipse [s], [degree].

    Returns
    -------
    cluster : array (mpc,) of int
        Number of the cluster.
    strongest : array (mpc,) of bool
        Whether the MPC is the strongest of its cluster.
    """
    delay, azimuth, gain = (table[name].values for name in ("delay", "azimuth", "path_gain"))
    strongest = np.zeros(len(delay), dtype=bool)
    round_of = np.zeros(len(delay), dtype=np.int64)
    remaining = np.lexsort((azimuth, delay, -gain, link))
    rounds = 0
    while len(remaining):  # one cluster of each link at once
        first = np.r_[True, np.diff(link[remaining]) != 0]
        head = remaining[first][np.cumsum(first) - 1]
        strongest[remaining[first]] = True
        squared_distance = ((delay[remaining] - delay[head]) / delay_window) ** 2
        squared_distance += (angle_difference(azimuth[remaining], azimuth[head]) / azimuth_window) ** 2
        round_of[remaining[squared_distance <= 1]] = rounds
        remaining = remaining[squared_distance > 1]
        rounds += 1
    numbers = np.unique(link * max(rounds, 1) + round_of, return_inverse=True)[1]
    return numbers.ravel(), strongest
