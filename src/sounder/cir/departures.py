"""Power at arrival, where the transmit antenna has several beams: as if it were omnidirectional."""

from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from sounder.instrument.antenna_pattern import Pattern
from sounder.instrument.description import Sounder

Real = NDArray[np.float64]


class ArrivalPower(NamedTuple):
    """Power in the beams of the receive antenna.

    Attributes
    ----------
    power : array (azimuth, elevation, delay)
        Linear; NaN where nothing was recorded.
    beams : int
        Beams of the transmit antenna of which each is the sum.
    overlap : float
        Gain that these have together, relative to the boresight of one, by which it is divided.
    links : array (tx_azimuth, tx_elevation, azimuth, elevation, delay) or None
        The power in each link, where there are several beams.
    strongest : array (azimuth, elevation)
        Number of the beam that brings the strongest sample.
    """

    power: Real
    beams: int
    overlap: float
    links: Real | None
    strongest: NDArray[np.intp]

    def of_strongest(self, values: xr.DataArray) -> NDArray[np.floating]:
        """Values (azimuth, elevation) of a quantity of each link, in the link of the strongest sample."""
        flat = values.values.reshape(self.beams, *self.strongest.shape)
        return np.asarray(np.take_along_axis(flat, self.strongest[None], axis=0)[0])


def power_at_arrival(cir: xr.Dataset, sounder: Sounder) -> ArrivalPower:
    """Sum of the power over the beams of the transmit antenna, over their overlap.

    The overlap is the gain of all beams together toward a direction of their scan (Sun et al., for the receive
    antenna). One beam overlaps nothing: its power stays.

    Parameters
    ----------
    cir : xarray.Dataset
        ``cir`` (azimuth, elevation, delay) or (tx_azimuth, tx_elevation, azimuth, elevation, delay).
    sounder : Sounder
        For the pattern of the transmit antenna.
    """
    links = np.abs(cir["cir"].values).astype(float) ** 2
    if "tx_azimuth" not in cir.dims:
        return ArrivalPower(links, 1, 1.0, None, np.zeros(links.shape[:2], np.intp))
    flat = links.reshape(-1, *links.shape[2:])
    recorded = np.isfinite(links).any(axis=(2, 3, 4))
    pattern = Pattern.of(sounder.tx_antenna)
    overlap = beam_overlap(cir["tx_azimuth"].values, cir["tx_elevation"].values, recorded, pattern)
    power = np.where(np.isnan(flat).all(axis=0), np.nan, np.nansum(flat, axis=0) / overlap)
    strongest = np.argmax(np.nan_to_num(flat).max(axis=-1), axis=0)
    return ArrivalPower(power, len(flat), overlap, links, strongest)


def beam_overlap(azimuth: Real, elevation: Real, recorded: NDArray[np.bool_], pattern: Pattern) -> float:
    """Sum of the relative gains of all recorded beams toward a direction of the scan, averaged over the scan."""
    a, e = (grid[recorded] for grid in np.meshgrid(azimuth, elevation, indexing="ij"))
    gains = 10 ** (pattern.beam_gain(a[:, None], e[:, None], a[None, :], e[None, :]) / 10)
    return float(gains.sum(axis=1).mean())
