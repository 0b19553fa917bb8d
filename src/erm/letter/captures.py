"""Where the captures of the study come from: a simulated instrument that another package provides.

This package knows geometry and MPC tables, but no instruments. A package that can simulate captures registers a module
under the entry-point group ``erm.captures``. The module has the functions of `Captures`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Any, Protocol, cast

import numpy as np
import xarray as xr

from erm.common.errors import DataError
from erm.geometry.vertical import FloatArray
from erm.maps.environment import Environment

if TYPE_CHECKING:
    from matplotlib.projections.polar import PolarAxes

GROUP = "erm.captures"


@dataclass(frozen=True)
class Link:
    """A pair of antennas.

    Parameters
    ----------
    name : str
        Of the receiver's position.
    tx, rx : tuple of float
        Positions, east/north/up [m].
    """

    name: str
    tx: tuple[float, float, float]
    rx: tuple[float, float, float]

    @property
    def distance(self) -> float:
        """Slant distance between the antennas [m]."""
        return float(np.linalg.norm(np.subtract(self.tx, self.rx)))


@dataclass(frozen=True)
class Campaign:
    """An environment and the links to measure in it.

    Parameters
    ----------
    name : str
    environment : Environment
        Environment to measure.
    links : tuple of Link
    frequency : float
        Carrier [Hz].
    max_order : int
        Largest number of bounces of the paths that are captured.
    parameters : mapping of str to str
        Texts that describe the set-up, under the names of the letter's Table 1.
    instrument : object
        The provider's own description of the instrument.
    """

    name: str
    environment: Environment
    links: tuple[Link, ...]
    frequency: float
    max_order: int
    parameters: Mapping[str, str]
    instrument: Any

    def at(self, links: Sequence[Link]) -> "Campaign":
        """Return the same campaign with other links."""
        return replace(self, links=tuple(links))

    def to_order(self, max_order: int) -> "Campaign":
        """Return the same campaign with another largest number of bounces."""
        return replace(self, max_order=max_order)


@dataclass(frozen=True)
class Change:
    """Changes of an instrument. None leaves a setting unchanged.

    Parameters
    ----------
    bandwidth : float, optional
        Sample rate [Hz]. The sequence grows with it, so that its period stays the same.
    azimuth_step : float, optional
        Angle between two directions of the scan [degree].
    beamwidth : float, optional
        Horizontal half-power beamwidth of the receive antenna [degree]. The gain falls as the beam widens.
    power : float
        Change of the transmitted power [dB].
    noise : bool
        Whether the receiver has thermal noise.
    snapshots : int, optional
        Captures in each direction.
    """

    bandwidth: float | None = None
    azimuth_step: float | None = None
    beamwidth: float | None = None
    power: float = 0.0
    noise: bool = True
    snapshots: int | None = None


UNCHANGED = Change()


@dataclass(frozen=True)
class Measured:
    """Results of the captures of a campaign.

    Parameters
    ----------
    mpcs : xarray.Dataset
        MPC table (`erm.mpcs.table`) of all positions.
    snr : array (mpc,)
        SNR in the strongest beam [dB].
    daps : mapping of str to xarray.Dataset
        DAPS of each position: ``daps`` (azimuth, elevation, delay) [dB], and what `Captures.draw_daps` needs.
    """

    mpcs: xr.Dataset
    snr: FloatArray
    daps: Mapping[str, xr.Dataset] = field(default_factory=dict)

    @property
    def median_snr(self) -> float:
        """Median over the MPCs [dB]; NaN if there are none."""
        return float(np.median(self.snr)) if self.snr.size else float("nan")


class Captures(Protocol):
    """A simulated instrument that makes captures of paths."""

    def campaign(self, scene: str) -> Campaign:
        """Return a campaign that ships with the instrument, by the name of its scene."""

    def measure(
        self, campaign: Campaign, change: Change = UNCHANGED, *, progress: Callable[[], None] | None = None
    ) -> Measured:
        """Make the raw captures of each position and process them to MPCs. ``progress`` is called after each."""

    def draw_daps(self, products: Sequence[tuple[str, xr.Dataset]], axes: "PolarAxes") -> "PolarAxes":
        """Draw the DAPS of one or two positions: azimuth as angle, delay as radius, power as colour."""


class Cached:
    """Captures that measure no link twice with the same instrument. DAPS are not kept.

    Parameters
    ----------
    captures : Captures
    """

    def __init__(self, captures: Captures) -> None:
        self._captures = captures
        self._known: dict[tuple[Link, int, Change], tuple[xr.Dataset, FloatArray]] = {}

    def campaign(self, scene: str) -> Campaign:
        """Return a campaign that ships with the instrument."""
        return self._captures.campaign(scene)

    def measure(
        self, campaign: Campaign, change: Change = UNCHANGED, *, progress: Callable[[], None] | None = None
    ) -> Measured:
        """Measure the links that were not measured before. ``progress`` is called after each new position."""
        keys = [(link, campaign.max_order, change) for link in campaign.links]
        new = [key[0] for key in keys if key not in self._known]
        if new:
            measured = self._captures.measure(campaign.at(new), change, progress=progress)
            position = measured.mpcs["position"].values
            for link in new:
                rows = np.flatnonzero(position == link.name)
                self._known[link, campaign.max_order, change] = measured.mpcs.isel(mpc=rows), measured.snr[rows]
        tables, snr = zip(*(self._known[key] for key in keys), strict=True)
        return Measured(xr.concat(tables, dim="mpc"), np.concatenate(snr))

    def draw_daps(self, products: Sequence[tuple[str, xr.Dataset]], axes: "PolarAxes") -> "PolarAxes":
        """Draw the DAPS of one or two positions."""
        return self._captures.draw_daps(products, axes)


def installed() -> Captures:
    """Find the instrument that is installed.

    Raises
    ------
    DataError
        No instrument is installed, or it cannot be imported.
    """
    for entry in entry_points(group=GROUP):
        try:
            return cast(Captures, entry.load())
        except ImportError as error:
            raise DataError(
                f"entry point {GROUP}: {entry.value} makes the captures of the study, but cannot be imported "
                f"({error}); reinstall its package"
            ) from error
    raise DataError(
        f"entry point {GROUP}: no installed package makes the captures of the study; "
        "pip install sounder-to-map, or reinstall it if this is a checkout"
    )
