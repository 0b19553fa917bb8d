"""Calibration of a survey: heading, clock and gain that are wrong for all measurements alike.

Each value is "measured minus true". A value is removed from a table only where the data are more likely with it than
without; whatever remains uncertain is told by attributes of the mended table.
"""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from erm.common.constants import c
from erm.geometry.vertical import FloatArray
from erm.mpcs.standard_errors import SIGMAS
from erm.mpcs.table import free_space_gain
from erm.survey.direct_paths import USUAL_CLOCK, USUAL_HEADING, DirectPaths, find_direct_paths
from erm.survey.observations import Observations

if TYPE_CHECKING:
    import xarray as xr

NAMES = ("heading", "clock", "gain")
"""Order of the common errors in covariances."""
UNITS = {"heading": "degree", "clock": "s", "gain": "dB"}
USUAL = {"heading": USUAL_HEADING, "clock": USUAL_CLOCK / c, "gain": 3.0}
"""Half of the common errors are below these; scales of Cauchy priors."""
LEAST_PATHS = 5.0
"""Fewest direct paths that are believed alone: fewer agree by chance."""
LEAST_EVIDENCE = 5.0
"""Least log-likelihood ratio of each direct path to another path: images agree by chance, but not so well."""


@dataclass(frozen=True)
class Calibration:
    """Common errors of a table: heading [degree], clock [s], gain [dB], each measured minus true."""

    heading: float = 0.0
    clock: float = 0.0
    gain: float = 0.0
    covariance: FloatArray = field(default_factory=lambda: np.zeros((3, 3)))
    """Covariance (3, 3) of heading, clock and gain."""
    ambiguous: tuple[str, ...] = NAMES
    """Names of the errors that the data do not show."""
    evidence: float = 0.0
    """Log-likelihood ratio to a table without direct paths."""
    direct_paths: int = 0
    """Number of direct paths behind it."""

    def std(self, name: str) -> float:
        """Standard error of one of the three."""
        return float(np.sqrt(self.covariance[NAMES.index(name), NAMES.index(name)]))

    @property
    def applied(self) -> dict[str, float]:
        """What is removed from the table: each error where it is more likely than none, else 0."""
        return {name: getattr(self, name) if self._odds(name) > 1 else 0.0 for name in NAMES}

    @property
    def remaining(self) -> dict[str, float]:
        """Standard deviation of what remains of each error after `applied` was removed."""
        result = {}
        for name, removed in self.applied.items():
            probability = self._odds(name) / (1 + self._odds(name))
            away, std = getattr(self, name) - removed, self.std(name)
            zero = removed**2  # if there is no error, what was removed remains
            result[name] = float(np.sqrt(probability * (std**2 + away**2) + (1 - probability) * zero))
        return result

    def _odds(self, name: str) -> float:
        """Odds of an error against none, with a Cauchy prior of the error."""
        value, std = getattr(self, name), self.std(name)
        if not std:
            return float(value != 0)
        prior = 1 / (np.pi * USUAL[name] * (1 + (value / USUAL[name]) ** 2))
        return float(prior * std * np.sqrt(2 * np.pi) * np.exp(min((value / std) ** 2 / 2, 500.0)))

    @property
    def significant(self) -> list[str]:
        """Names of the errors beyond three standard errors."""
        return [name for name, value in self.applied.items() if abs(value) > SIGMAS * self.std(name)]


def calibrate(table: "xr.Dataset") -> Calibration:
    """Estimate the errors of heading, clock and gain that all measurements share.

    Parameters
    ----------
    table : xarray.Dataset
        MPC table (`erm.make_table`).

    Examples
    --------
    >>> import erm, xarray as xr
    >>> from erm.survey.calibration import apply, calibrate
    >>> street = erm.Environment.walls([[[-60, 10], [60, 10]]], top=40.0)
    >>> links = [erm.predict(street, (0, 0, 9), (x, -4, 2), 132e9) for x in range(10, 40, 4)]
    >>> table = xr.concat(links, dim="mpc")
    >>> turned = table.assign(azimuth=table["azimuth"] + 5, delay=table["delay"] + 3e-9)
    >>> found = calibrate(turned)
    >>> round(found.heading, 2), round(found.clock * 1e9, 2)
    (5.0, 3.0)
    >>> bool(abs(apply(turned, found)["delay"] - table["delay"]).max() < 1e-12)
    True
    """
    seen = Observations.of(table)
    found = find_direct_paths(seen)
    if not found or found[0].number < LEAST_PATHS or found[0].evidence < LEAST_EVIDENCE * found[0].number:
        return Calibration(covariance=np.diag([USUAL[name] ** 2 for name in NAMES]))
    return _from_direct_paths(seen, found[0])


def apply(table: "xr.Dataset", calibration: Calibration) -> "xr.Dataset":
    """Remove common errors from a table.

    Parameters
    ----------
    table : xarray.Dataset
        MPC table.
    calibration : Calibration
        From `calibrate`.

    Returns
    -------
    xarray.Dataset
        The mended table. Attributes ``heading_error`` [degree], ``clock_error`` [s], ``gain_error`` [dB] tell what was
        removed, and ``common_heading_std``, ``common_clock_std``, ``common_gain_std`` what uncertainty remains that all
        rows share. The latter come from the same paths: they are no independent knowledge.
    """
    removed, remaining = calibration.applied, calibration.remaining
    columns = {"heading": "azimuth", "clock": "delay", "gain": "path_gain"}
    mended = {column: table[column] - removed[name] for name, column in columns.items() if removed[name]}
    attributes = {f"{name}_error": removed[name] for name in NAMES}
    attributes |= {f"common_{name}_std": remaining[name] for name in NAMES}
    mended = {column: values.assign_attrs(table[column].attrs) for column, values in mended.items()}
    return table.assign(mended).assign_attrs(attributes)


def _from_direct_paths(seen: Observations, found: DirectPaths) -> Calibration:
    """Calibration by direct paths, and the gain that they show."""
    weight = found.weight
    clock_std, heading_std = (
        np.hypot(seen.length_std, found.clock_spread),
        np.hypot(seen.azimuth_std, found.heading_spread),
    )
    clock, heading = (1 / np.sqrt(np.sum(weight / std**2)) for std in (clock_std, heading_std))
    rows = np.flatnonzero((weight > 0.5) & np.isfinite(seen.gain))
    gain, gain_std = 0.0, USUAL["gain"]
    if len(rows) >= LEAST_PATHS:
        excess = seen.gain[rows] - free_space_gain(seen.length[rows] - found.clock, seen.frequency[rows])
        gain = float(np.median(excess))
        # the standard error of a median is 1.25 that of a mean
        gain_std = float(1.25 * 1.4826 * np.median(np.abs(excess - gain)) / np.sqrt(len(rows)) + 0.1)
    return Calibration(
        heading=found.heading,
        clock=found.clock / c,
        gain=gain,
        covariance=np.diag([heading**2, (clock / c) ** 2, gain_std**2]),
        ambiguous=(),
        evidence=found.evidence,
        direct_paths=len(rows),
    )
