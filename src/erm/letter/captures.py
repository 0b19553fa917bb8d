"""Where the study's captures come from: an instrument that another package provides.

This package knows geometry and MPC tables, no instruments. Whoever can carry paths through an instrument registers a
module under the entry-point group ``erm.captures``; it has the functions of `Captures`.
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
        """From antenna to antenna, aslant [m]."""
        return float(np.linalg.norm(np.subtract(self.tx, self.rx)))


@dataclass(frozen=True)
class Campaign:
    """What is measured where.

    Parameters
    ----------
    name : str
    environment : Environment
        That is measured.
    links : tuple of Link
    frequency : float
        Carrier [Hz].
    max_order : int
        Largest number of bounces of the paths that are captured.
    parameters : mapping of str to str
        The set-up in words, under the names of the letter's Table 1.
    instrument : object
        The provider's own description of it.
    """

    name: str
    environment: Environment
    links: tuple[Link, ...]
    frequency: float
    max_order: int
    parameters: Mapping[str, str]
    instrument: Any

    def at(self, links: Sequence[Link]) -> "Campaign":
        """The same campaign between other antennas."""
        return replace(self, links=tuple(links))

    def to_order(self, max_order: int) -> "Campaign":
        """The same campaign with paths of more or fewer bounces."""
        return replace(self, max_order=max_order)


@dataclass(frozen=True)
class Change:
    """What is changed about an instrument; None leaves a setting as it is.

    Parameters
    ----------
    bandwidth : float, optional
        Sample rate [Hz]; the sequence grows with it, so that its period stays.
    azimuth_step : float, optional
        Between two directions of the scan [degree].
    beamwidth : float, optional
        Horizontal half-power beamwidth of the receive antenna [degree]; its gain falls as the beam widens.
    power : float
        Added to the transmitted power [dB].
    noise : bool
        Whether the receiver has thermal noise.
    snapshots : int, optional
        Captures a direction.
    """

    bandwidth: float | None = None
    azimuth_step: float | None = None
    beamwidth: float | None = None
    power: float = 0.0
    noise: bool = True
    snapshots: int | None = None


AS_IT_IS = Change()


@dataclass(frozen=True)
class Measured:
    """What came out of a campaign's captures.

    Parameters
    ----------
    mpcs : xarray.Dataset
        MPC table (`erm.mpcs.table`) of all positions.
    snr : array (mpc,)
        Power over noise in the strongest beam [dB].
    daps : mapping of str to xarray.Dataset
        By position: ``daps`` (azimuth, elevation, delay) [dB] and what else `Captures.draw_daps` needs.
    """

    mpcs: xr.Dataset
    snr: FloatArray
    daps: Mapping[str, xr.Dataset] = field(default_factory=dict)

    @property
    def median_snr(self) -> float:
        """Median over the MPCs [dB]; NaN of none."""
        return float(np.median(self.snr)) if self.snr.size else float("nan")


class Captures(Protocol):
    """An instrument to carry paths through."""

    def campaign(self, scene: str) -> Campaign:
        """A campaign that ships with the instrument, by its scene's name."""

    def measure(
        self, campaign: Campaign, change: Change = AS_IT_IS, *, progress: Callable[[], None] | None = None
    ) -> Measured:
        """Make the raw captures of each position, and process them to MPCs; ``progress`` is called after each."""

    def draw_daps(self, products: Sequence[tuple[str, xr.Dataset]], axes: "PolarAxes") -> "PolarAxes":
        """Draw the DAPS of one or two positions: angle azimuth, radius delay, colour power."""


class Remembered:
    """Captures of which no link is measured twice with the same instrument; their DAPS are not kept.

    Parameters
    ----------
    captures : Captures
    """

    def __init__(self, captures: Captures) -> None:
        self._captures = captures
        self._known: dict[tuple[Link, int, Change], tuple[xr.Dataset, FloatArray]] = {}

    def campaign(self, scene: str) -> Campaign:
        """A campaign that ships with the instrument."""
        return self._captures.campaign(scene)

    def measure(
        self, campaign: Campaign, change: Change = AS_IT_IS, *, progress: Callable[[], None] | None = None
    ) -> Measured:
        """Measure what is not known yet; ``progress`` is called after each new position."""
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
        There is none, or it cannot be imported.
    """
    for entry in entry_points(group=GROUP):
        try:
            return cast(Captures, entry.load())
        except ImportError as error:
            raise DataError(
                f"entry point {GROUP}: {entry.value} makes the captures that the study needs, but cannot be imported "
                f"({error}); reinstall the package it belongs to"
            ) from error
    raise DataError(
        f"entry point {GROUP}: no installed package makes captures, which the study needs; "
        "pip install sounder-to-map, or reinstall it if this is a checkout"
    )
