"""Measured paths as plain arrays, taken from a table once."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from erm.common.constants import c
from erm.geometry.vertical import FloatArray, virtual_anchor
from erm.mpcs.antenna_pairs import distinct_rows
from erm.mpcs.faces import elevation_excess
from erm.mpcs.selection import ELEVATION_STD
from erm.mpcs.table import path_length
from erm.reconstruction.model.clutter import density_of_stronger

if TYPE_CHECKING:
    import xarray as xr

CLUTTER_ELEVATIONS = 30.0
"""Range of the elevations of clutter [degree]: that of a scan of three elevations a beam of ten degrees apart. A larger
scan has more, and clutter with the elevation of a wall is rarer."""

IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]


class PathColumns(NamedTuple):
    """The columns (path,) of `Paths` that a line predicts paths from. Loops gather them by the million."""

    tx_east: FloatArray  # m
    tx_north: FloatArray  # m
    rx_east: FloatArray  # m
    rx_north: FloatArray  # m
    height_difference: FloatArray  # m, transmitter minus receiver
    length: FloatArray  # m, slant
    azimuth: FloatArray  # degree, of arrival
    length_std: FloatArray  # m
    azimuth_std: FloatArray  # degree

    def take(self, rows: IntArray | BoolArray) -> "PathColumns":
        """Return the paths of an index or mask."""
        return PathColumns(*(column[rows] for column in self))


@dataclass(frozen=True)
class Paths:
    """Measured paths that may be single reflections, as plain arrays along ``path``.

    Parameters
    ----------
    tx, rx : array (path, 3)
        Antenna positions [m].
    length, azimuth : array (path,)
        Slant length [m] and azimuth of arrival [degree].
    length_std, azimuth_std : array (path,)
        Their standard errors.
    link : array (path,) of int
        Pair of antennas. A wall has at most one path of a link.
    transmitter : array (path,) of int
        Number of the transmitter's position.
    loss, loss_std : array (path,)
        Reflection loss and its standard error [dB].
    wavelength : array (path,)
        [m].
    elevation_excess, elevation_std : array (path,)
        Elevation minus that of a path off vertical walls, and its standard error [degree]; NaN if unknown.
    row : array (path,) of int
        Row of the table. Hypotheses about one MPC share a row.
    scatter : array (path, 2)
        Standard deviations of length [m] and azimuth [degree] that the relief of a facade adds. Those of the standard
        errors contain them.
    clutter : array (path,)
        Density of the paths of its link about it that are stronger (`erm.reconstruction.model.clutter`)
        [1/(m degree)].
    """

    tx: FloatArray
    rx: FloatArray
    length: FloatArray
    azimuth: FloatArray
    length_std: FloatArray
    azimuth_std: FloatArray
    link: IntArray
    transmitter: IntArray
    loss: FloatArray
    loss_std: FloatArray
    wavelength: FloatArray
    elevation_excess: FloatArray
    elevation_std: FloatArray
    row: IntArray
    scatter: FloatArray
    clutter: FloatArray

    @classmethod
    def from_table(cls, table: "xr.Dataset", clutter: FloatArray | None = None) -> "Paths":
        """Return all MPCs of a table of `erm.mpcs.selection.select`, in its order; their ``clutter`` if it is known."""
        tx, length, azimuth = table["tx_position"].values, path_length(table), table["azimuth"].values
        std = table["delay_std"].values * c, table["azimuth_std"].values
        link, loss = table["link"].values, table["reflection_loss"].values
        if clutter is None:
            clutter = density_of_stronger(length, azimuth, std, loss, link)
        return cls(
            tx=tx,
            rx=table["rx_position"].values,
            length=length,
            azimuth=azimuth,
            length_std=std[0],
            azimuth_std=std[1],
            link=link,
            transmitter=distinct_rows(tx)[1],
            loss=loss,
            loss_std=table["reflection_loss_std"].values,
            wavelength=c / table["frequency"].values,
            elevation_excess=elevation_excess(table),
            elevation_std=table["elevation_std"].values,
            row=np.arange(table.sizes["mpc"]),
            scatter=np.zeros((table.sizes["mpc"], 2)),
            clutter=clutter,
        )

    @classmethod
    def concatenate(cls, parts: Sequence["Paths"]) -> "Paths":
        """Return the paths of several parts, one after another."""
        return cls(*(np.concatenate([getattr(part, one.name) for part in parts]) for one in fields(cls)))

    def __len__(self) -> int:
        return len(self.length)

    @cached_property
    def columns(self) -> PathColumns:
        """The columns that a line predicts paths from, contiguous in memory."""
        (tx_east, tx_north, tx_up), (rx_east, rx_north, rx_up) = (
            np.ascontiguousarray(end.T) for end in (self.tx, self.rx)
        )
        return PathColumns(
            tx_east,
            tx_north,
            rx_east,
            rx_north,
            tx_up - rx_up,
            self.length,
            self.azimuth,
            self.length_std,
            self.azimuth_std,
        )

    def take(self, rows: IntArray | BoolArray) -> "Paths":
        """Return the paths of an index or mask."""
        rows = np.flatnonzero(rows) if rows.dtype == bool else rows
        return Paths(*(getattr(self, one.name).take(rows, axis=0) for one in fields(self)))

    def with_errors(self, length_std: FloatArray, azimuth_std: FloatArray) -> "Paths":
        """Return the same paths with other standard errors."""
        return replace(self, length_std=length_std, azimuth_std=azimuth_std)

    @cached_property
    def elevation_misfit(self) -> FloatArray:
        """Squared deviation (path,) of the elevation from that of a path off vertical walls; 0 where it is unknown."""
        std = np.hypot(self.elevation_std, ELEVATION_STD)
        return np.nan_to_num((self.elevation_excess / std) ** 2)

    @cached_property
    def elevation_log_odds(self) -> FloatArray:
        """Log odds (path,) of elevations to be those off vertical walls and not clutter's; 0 where unknown."""
        spread = np.sqrt(2 * np.pi) * np.hypot(self.elevation_std, ELEVATION_STD)
        odds = -self.elevation_misfit / 2 - np.log(np.minimum(spread / CLUTTER_ELEVATIONS, 1.0))
        return np.where(np.isnan(self.elevation_excess), 0.0, odds)

    def virtual_anchors(self) -> FloatArray:
        """Mirror image (path, 2) of the transmitter that each path points to [m]."""
        return virtual_anchor(self.tx, self.rx, self.length, self.azimuth)
