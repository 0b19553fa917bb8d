"""Measured paths as plain arrays."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from erm.geometry import FloatArray, virtual_anchor

IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Rays:
    """What of measured paths a wall predicts, along ``path``.

    Parameters
    ----------
    tx, rx : array (path, 3)
        Antenna positions [m].
    length, azimuth : array (path,)
        Slant length [m] and azimuth of arrival [degree].
    length_std, azimuth_std : array (path,)
        Their standard errors.
    """

    tx: FloatArray
    rx: FloatArray
    length: FloatArray
    azimuth: FloatArray
    length_std: FloatArray
    azimuth_std: FloatArray

    def __len__(self) -> int:
        return len(self.length)

    def rays(self, rows: IntArray | BoolArray | slice) -> "Rays":
        """Return those of an index or mask, without what else is known of them."""
        return Rays(
            self.tx[rows],
            self.rx[rows],
            self.length[rows],
            self.azimuth[rows],
            self.length_std[rows],
            self.azimuth_std[rows],
        )


@dataclass(frozen=True)
class Paths(Rays):
    """Measured paths that may be single bounces.

    Parameters
    ----------
    link : array (path,) of int
        Pair of antennas; a wall makes one path a link.
    transmitter : array (path,) of int
        Number of the place where the transmitter stood.
    loss, loss_std : array (path,)
        Reflection loss and its standard error [dB].
    wavelength : array (path,)
        [m].
    rise, rise_std : array (path,)
        Elevation less that of a path off vertical faces, and its standard error [degree]; NaN if not known.
    row : array (path,) of int
        Row of the table; hypotheses on one component share it.
    """

    link: IntArray
    transmitter: IntArray
    loss: FloatArray
    loss_std: FloatArray
    wavelength: FloatArray
    rise: FloatArray
    rise_std: FloatArray
    row: IntArray

    def take(self, rows: IntArray | BoolArray) -> "Paths":
        """Return the paths of an index or mask."""
        return Paths(*(value[rows] for value in vars(self).values()))

    def with_errors(self, length_std: FloatArray, azimuth_std: FloatArray) -> "Paths":
        """Return the same paths with other standard errors."""
        return replace(self, length_std=length_std, azimuth_std=azimuth_std)

    def anchors(self) -> FloatArray:
        """Mirror image (path, 2) of the transmitter that each path points to [m]."""
        return virtual_anchor(self.tx, self.rx, self.length, self.azimuth)
