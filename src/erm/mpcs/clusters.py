"""Which components of an antenna pair stand together in delay and azimuth."""

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
    """Group the components of each link around its strongest ones.

    The strongest component left over claims all that lie within an ellipse about it in the plane of delay
    and azimuth (circular), until none is left. Diffuse tails and sidelobes thus fall to the specular path
    that causes them.

    Returns
    -------
    cluster : array (mpc,) of int
    strongest : array (mpc,) of bool
    """
    delay, azimuth, gain = (table[name].values for name in ("delay", "azimuth", "path_gain"))
    strongest = np.zeros(len(delay), dtype=bool)
    round_of = np.zeros(len(delay), dtype=np.int64)
    left = np.lexsort((azimuth, delay, -gain, link))
    rounds = 0
    while len(left):  # all links at once: the strongest left of each claims its cluster
        first = np.r_[True, np.diff(link[left]) != 0]
        head = left[first][np.cumsum(first) - 1]
        strongest[left[first]] = True
        apart = ((delay[left] - delay[head]) / delay_window) ** 2
        apart += (angle_difference(azimuth[left], azimuth[head]) / azimuth_window) ** 2
        round_of[left[apart <= 1]] = rounds
        left = left[apart > 1]
        rounds += 1
    numbers = np.unique(link * max(rounds, 1) + round_of, return_inverse=True)[1]
    return numbers.ravel(), strongest
