"""Where the study's captures come from: an instrument that another package provides.

This package knows geometry and MPC tables, no instruments. Whoever can carry paths through an instrument registers a
module under the entry-point group ``erm.captures``; it has the functions of `Captures`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Any, Protocol, cast

import numpy as np

from erm.environment import Environment
from erm.errors import DataError

if TYPE_CHECKING:
    import xarray as xr
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
        MPC table (`erm.mpc_table`) of all positions.
    daps : mapping of str to xarray.Dataset
        By position: ``daps`` (azimuth, elevation, delay) [dB] and what else `Captures.draw_daps` needs.
    snr : float
        Median over the MPCs of power over noise in the strongest beam [dB].
    """

    mpcs: "xr.Dataset"
    daps: Mapping[str, "xr.Dataset"] = field(default_factory=dict)
    snr: float = float("nan")


class Captures(Protocol):
    """An instrument to carry paths through."""

    def campaign(self, scene: str) -> Campaign:
        """A campaign that ships with the instrument, by its scene's name."""

    def measure(
        self, campaign: Campaign, change: Change = AS_IT_IS, *, progress: Callable[[], None] | None = None
    ) -> Measured:
        """Make the raw captures of each position, and process them to MPCs; ``progress`` is called after each."""

    def draw_daps(self, products: Sequence[tuple[str, "xr.Dataset"]], axes: "PolarAxes") -> "PolarAxes":
        """Draw the DAPS of one or two positions: angle azimuth, radius delay, colour power."""


def installed() -> Captures:
    """Find the instrument that is installed.

    Raises
    ------
    DataError
        There is none.
    """
    for entry in entry_points(group=GROUP):
        return cast(Captures, entry.load())
    raise DataError(
        f"entry point {GROUP}: no installed package makes captures, which the study needs; "
        "pip install sounder-to-map, or reinstall it if this is a checkout"
    )
