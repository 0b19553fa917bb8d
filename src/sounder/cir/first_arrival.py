"""Impulse responses of a position whose captures began at an arbitrary time: where the first arrival is."""

import numpy as np
import xarray as xr

from erm.common.constants import c
from erm.common.significance import FALSE_ALARM
from sounder.cir.power_spectrum import noise_power

DYNAMIC_RANGE = 25.0
"""How far the first arrival may be below the strongest path [dB]: the dynamic range of the threshold of NYU."""


def place_first_arrival(cir: xr.Dataset, distance: float) -> xr.Dataset:
    """Turn the delays of a position so that its first arrival is at the delay of the direct path.

    Delays are known modulo the period ``P``, so *first* needs a beginning: that of the paths after the longest time
    without any. What stands out of the noise of its beam, and is at most `DYNAMIC_RANGE` below the strongest path,
    is a path. The turn is by whole samples, one more than needed, so that no path comes before the direct one.

    Parameters
    ----------
    cir : xarray.Dataset
        ``cir`` (azimuth, elevation, delay), all directions begun together.
    distance : float
        From TX to RX [m].

    Returns
    -------
    xarray.Dataset
        The same with another ``cir``.

    Examples
    --------
    >>> response = np.full((1, 1, 40), 1e-6 + 0j)
    >>> response[0, 0, [3, 30, 33]] = 0.3, 1.0, 0.5  # 30 comes after the longest silence
    >>> dataset = xr.Dataset({"cir": (("azimuth", "elevation", "delay"), response)}, {"delay": np.arange(40) * 1e-9})
    >>> moved = place_first_arrival(dataset, distance=6.0)  # 20.01 ns
    >>> np.flatnonzero(abs(moved["cir"].values[0, 0]) > 1e-3).tolist()
    [22, 25, 35]
    """
    power = np.abs(np.nan_to_num(cir["cir"].values)) ** 2
    floor = noise_power(power)[..., None]
    seen = power > np.maximum(-np.log(FALSE_ALARM / power.shape[-1]) * floor, power.max() * 10 ** (-DYNAMIC_RANGE / 10))
    at = np.flatnonzero(seen.reshape(-1, seen.shape[-1]).any(axis=0))
    if not at.size:
        return cir
    silences = np.diff(at, prepend=at[-1] - power.shape[-1])
    first = at[np.argmax(silences)]
    delay = cir["delay"].values
    wanted = int(np.ceil(distance / c / (delay[1] - delay[0]))) + 1
    return cir.assign(cir=(cir["cir"].dims, np.roll(cir["cir"].values, wanted - first, axis=-1), cir["cir"].attrs))
