"""The columns of an MPC table that tell about errors of a survey, as arrays."""

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from erm.common.constants import c
from erm.geometry.vertical import FloatArray, angle_difference, azimuth_of
from erm.mpcs.antenna_pairs import links
from erm.mpcs.selection import ELEVATION_TOLERANCE
from erm.mpcs.standard_errors import ASSUMED, SIGMAS, SMALLEST_ERRORS

if TYPE_CHECKING:
    import xarray as xr

LEAST_FACTOR = 1e-2
"""Smallest factor of errors that were assumed: residuals may be 0."""
IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Observations:
    """MPCs of all antenna pairs: lengths in metres, angles in degrees."""

    link: IntArray
    """Index (mpc,) of the antenna pair."""
    length: FloatArray
    """Delay times the speed of light (mpc,) [m]."""
    azimuth: FloatArray
    elevation: FloatArray
    """Angles (mpc,) [degree]; the elevation is NaN where it is unknown."""
    gain: FloatArray
    """Path gain (mpc,) [dB]; NaN where it is unknown."""
    frequency: FloatArray
    """[Hz]"""
    length_std: FloatArray
    azimuth_std: FloatArray
    elevation_std: FloatArray
    """Standard errors (mpc,) [m], [degree]; assumed ones where the table has none."""
    stated: npt.NDArray[np.bool_]
    """Whether (mpc,) the standard errors are those of the table."""
    tx: FloatArray
    rx: FloatArray
    """Places (link, 3) of the antennas [m]."""

    @classmethod
    def of(cls, table: "xr.Dataset") -> "Observations":
        """Read a table."""
        link = links(table)
        _, first = np.unique(link, return_index=True)
        assumed = (ASSUMED.delay, ASSUMED.azimuth, ASSUMED.elevation)
        stds = [
            np.maximum(np.where(np.isnan(std), usual, std), least)
            for std, usual, least in zip(
                (table[f"{name}_std"].values for name in ("delay", "azimuth", "elevation")),
                assumed,
                SMALLEST_ERRORS,
                strict=True,
            )
        ]
        return cls(
            link=link,
            length=table["delay"].values * c,  # may be negative before the clock is known
            azimuth=table["azimuth"].values,
            elevation=table["elevation"].values,
            gain=table["path_gain"].values,
            frequency=table["frequency"].values,
            length_std=stds[0] * c,
            azimuth_std=stds[1],
            elevation_std=stds[2],
            stated=np.isfinite(table["delay_std"].values) & np.isfinite(table["azimuth_std"].values),
            tx=table["tx_position"].values[first],
            rx=table["rx_position"].values[first],
        )

    def with_errors(self, length: float, azimuth: float) -> "Observations":
        """Return errors that agree with residuals: times factors; those of the table do not become smaller."""
        factors = [np.where(self.stated, max(one, 1.0), max(one, LEAST_FACTOR)) for one in (length, azimuth)]
        return replace(self, length_std=self.length_std * factors[0], azimuth_std=self.azimuth_std * factors[1])

    @property
    def distance(self) -> FloatArray:
        """Distance (link,) of the antennas [m]."""
        return np.asarray(np.linalg.norm(self.tx - self.rx, axis=-1))

    @property
    def excess_length(self) -> FloatArray:
        """Length (mpc,) beyond that of the direct path [m]: the clock's error, if the path is the direct one."""
        return self.length - self.distance[self.link]

    @property
    def excess_azimuth(self) -> FloatArray:
        """Azimuth (mpc,) from the direction of the transmitter [degree]: the heading's error of a direct path."""
        return angle_difference(self.azimuth, azimuth_of(self.tx - self.rx)[self.link])

    @property
    def direct_elevation(self) -> FloatArray:
        """Elevation (link,) of the transmitter [degree]."""
        difference = self.tx - self.rx
        return np.rad2deg(np.arctan2(difference[:, 2], np.hypot(difference[:, 0], difference[:, 1])))

    def of_links(self, chosen: IntArray) -> "Observations":
        """The MPCs of some antenna pairs."""
        number = np.full(len(self.tx), -1)
        number[chosen] = np.arange(len(chosen))
        few = self.of_rows(number[self.link] >= 0)
        return replace(few, link=number[few.link], tx=self.tx[chosen], rx=self.rx[chosen])

    def of_rows(self, rows: npt.NDArray[np.bool_] | IntArray) -> "Observations":
        """Some of the MPCs."""
        columns = [one.name for one in fields(self) if one.name not in ("tx", "rx")]
        return replace(self, **{name: getattr(self, name)[rows] for name in columns})

    @property
    def may_be_off_vertical_walls(self) -> npt.NDArray[np.bool_]:
        """Whether (mpc,) the elevation is that of a path off vertical walls, or unknown."""
        climb = (self.tx - self.rx)[self.link, 2]
        expected = np.rad2deg(np.arcsin(np.clip(climb / np.maximum(self.length, np.abs(climb) + 1e-9), -1, 1)))
        return ~(np.abs(self.elevation - expected) > ELEVATION_TOLERANCE + SIGMAS * self.elevation_std)
