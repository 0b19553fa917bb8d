"""Calibration of a survey: heading, clock and gain that are wrong for all measurements alike.

Each value is "measured minus true". A value is removed from a table only where the data are more likely with it than
without; whatever remains uncertain is told by attributes of the mended table.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from erm.common.constants import c
from erm.common.odds import TWENTY_TO_ONE
from erm.geometry.vertical import FloatArray, angle_difference
from erm.mpcs.standard_errors import SIGMAS
from erm.survey.direct_paths import (
    LEAST_EVIDENCE,
    SPREADS,
    USUAL_CLOCK,
    USUAL_HEADING,
    DirectPaths,
    direct_paths_at,
    find_direct_paths,
    latest_clock,
)
from erm.survey.gains import USUAL_GAIN, gain_offset
from erm.survey.image_fit import fit_images
from erm.survey.observations import Observations
from erm.survey.sharpness import Sharpness

if TYPE_CHECKING:
    import xarray as xr

NAMES = ("heading", "clock", "gain")
"""Order of the common errors in covariances."""
UNITS = {"heading": "degree", "clock": "s", "gain": "dB"}
USUAL = {"heading": USUAL_HEADING, "clock": USUAL_CLOCK / c, "gain": USUAL_GAIN}
"""Half of the common errors are below these; scales of Cauchy priors."""
CERTAIN_DIRECT = 8.0
"""Number of direct paths that are believed without looking at images."""
FEWEST_DIRECT = 3
"""Fewest direct paths that make a heading certain, together with images."""
MOST_VOTES = 3
"""Votes of direct paths that are compared with images; chosen for time."""
MARGIN = 10.0
"""Least log-likelihood ratio to another heading."""
REPEATED = 4.0
"""How often a path counts in the sharpness of images: each pair counts for both of its paths, in double bounces again.
Chosen; `benchmarks/survey.py` compares errors with what is stated."""
SAME_HEADING, SAME_CLOCK = 0.5, 0.1
"""Differences from the most likely heading [degree] and clock [m] that are no alternative."""
OTHER_HEADING = 3.0
"""Difference of headings that are not the same [degree]."""


@dataclass(frozen=True)
class Calibration:
    """Common errors of a table: heading [degree], clock [s], gain [dB], each measured minus true."""

    heading: float = 0.0
    clock: float = 0.0
    gain: float = 0.0
    covariance: FloatArray = field(default_factory=lambda: np.zeros((3, 3)))
    """Covariance (3, 3) of heading, clock and gain."""
    spreads: Mapping[str, float] = field(default_factory=lambda: dict.fromkeys(NAMES, 0.0))
    """Standard deviations of the errors of single positions, beyond those of their MPCs."""
    ambiguous: tuple[str, ...] = NAMES
    """Names of the errors that the data do not show."""
    clocks: tuple[float, ...] = ()
    """Clocks [s] at which images agree nearly as well, the likeliest first."""
    clock_doubt: float = 0.0
    """Standard deviation [s] among them, part of the standard error of the clock."""
    evidence: float = 0.0
    """Log-likelihood ratio to a table without direct paths."""
    direct_paths: int = 0
    """Number of direct paths behind it."""
    images: int = 0
    """Number of common mirror images behind it."""

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
    def common(self) -> bool:
        """Whether positions may share an error of heading or clock that is not known: unless direct paths show none.

        What such paths show to be none is exact: an error that is left would only turn and scale the map.
        """
        removed = any(self.applied[name] for name in ("heading", "clock"))
        return removed or (self.images > 0 and self.direct_paths < FEWEST_DIRECT)

    @property
    def significant(self) -> list[str]:
        """Names of the errors beyond three standard errors."""
        return [name for name, value in self.applied.items() if abs(value) > SIGMAS * self.std(name)]


def calibrate(table: "xr.Dataset") -> Calibration:
    """Estimate the errors of heading, clock and gain that all measurements share.

    Direct paths (`erm.survey.direct_paths`) and the sharpness of mirror images (`erm.survey.sharpness`) find the most
    likely heading and clock; a fit to both (`erm.survey.image_fit`) gives their values and covariance.

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
    if not len(seen.link):
        return Calibration()
    start = _start(seen)
    direct, spreads = start.direct, (start.direct.clock_spread, start.direct.heading_spread)
    likely = direct.weight > 0.5
    fit = fit_images(seen, direct.heading, direct.clock, spreads, likely)
    enough = np.count_nonzero(likely) >= FEWEST_DIRECT
    if fit is None or not (enough or start.distinct):
        gain = gain_offset(seen, 0.0, np.zeros(len(likely), dtype=bool))
        covariance = np.diag([USUAL["heading"] ** 2, USUAL["clock"] ** 2, gain.std**2])
        return Calibration(gain=gain.offset, covariance=covariance, evidence=direct.evidence)
    spreads = fit.spreads
    gain = gain_offset(seen, fit.clock, likely)
    covariance = np.zeros((3, 3))
    covariance[:2, :2] = (fit.covariance + start.doubt) / np.outer([1, c], [1, c])
    covariance[2, 2] = gain.std**2
    # worse than a single measurement: nothing that is worth its name
    single = {
        "heading": float(np.median(np.hypot(seen.azimuth_std, spreads[1]))),
        "clock": float(np.median(np.hypot(seen.length_std, spreads[0]))) / c,
        "gain": USUAL["gain"],
    }
    return Calibration(
        heading=fit.heading,
        clock=fit.clock / c,
        gain=gain.offset,
        covariance=covariance,
        spreads={"heading": spreads[1], "clock": spreads[0] / c, "gain": gain.spread},
        ambiguous=tuple(name for i, name in enumerate(NAMES) if covariance[i, i] > single[name] ** 2),
        clocks=tuple(clock / c for clock in start.clocks),
        clock_doubt=float(np.sqrt(start.doubt[1, 1])) / c,
        evidence=start.evidence,
        direct_paths=int(np.count_nonzero(likely)),
        images=fit.images,
    )


def refined(calibration: Calibration, located: "xr.Dataset") -> Calibration:
    """Heading and clock as the adjustment of walls and positions found them (`PositionErrors.described`), if it did."""
    if "adjusted_heading" not in located.attrs:
        return calibration
    single = {"heading": located.attrs["azimuth_std"], "clock": located.attrs["delay_std"]}
    values = {name: located.attrs[f"adjusted_{name}"] for name in single}
    stds = {name: located.attrs[f"adjusted_{name}_std"] for name in single}
    covariance = np.diag([stds["heading"], stds["clock"], calibration.std("gain")]) ** 2
    ambiguous = tuple(name for name in calibration.ambiguous if name not in single or stds[name] > single[name])
    return replace(calibration, **values, covariance=covariance, ambiguous=ambiguous)


class _Start(NamedTuple):
    """Most likely heading and clock."""

    evidence: float
    direct: DirectPaths
    distinct: bool
    """Whether no other heading is nearly as likely."""
    doubt: FloatArray
    """Covariance (2, 2) of heading [degree] and clock [m] among all that are nearly as likely."""
    clocks: list[float]
    """Different clocks [m] among these, the likeliest first."""


def _start(seen: Observations) -> _Start:
    """Find the most likely heading and clock by direct paths and by the sharpness of images."""
    votes = find_direct_paths(seen)
    best = votes[0]
    if best.number >= CERTAIN_DIRECT and best.evidence > LEAST_EVIDENCE * best.number:
        return _Start(best.evidence, best, True, np.zeros((2, 2)), [])
    found = []
    latest = latest_clock(seen)
    for spreads in SPREADS:
        sharpness = Sharpness(seen, *spreads)
        tried = [(peak.clock, peak.heading) for peak in sharpness.search(latest)]
        tried += [(one.clock, one.heading) for one in votes[:MOST_VOTES]]
        for clock, heading in tried:
            direct = direct_paths_at(seen, clock, heading, spreads)
            evidence = sharpness.evidence(direct.clock, direct.heading) + direct.evidence
            found.append((evidence, direct))
    found.sort(key=lambda one: -one[0])
    evidence, direct = found[0]
    others = [one[0] for one in found if abs(angle_difference(one[1].heading, direct.heading)) > OTHER_HEADING]
    distinct = evidence - max(others, default=0.0) > MARGIN
    clocks: list[float] = []
    for other, one in found:
        if evidence - other < REPEATED * TWENTY_TO_ONE and all(abs(one.clock - clock) > SAME_CLOCK for clock in clocks):
            clocks.append(one.clock)
    return _Start(evidence, direct, distinct, _doubt(found), clocks)


def _doubt(found: list[tuple[float, DirectPaths]]) -> FloatArray:
    """Covariance (2, 2) of heading and clock about the most likely ones, over all that were found."""
    best = found[0][1]
    weight = np.exp((np.array([evidence for evidence, _ in found]) - found[0][0]) / REPEATED)
    away = np.array([(angle_difference(one.heading, best.heading), one.clock - best.clock) for _, one in found])
    # what is not told apart from the best is in the covariance of its fit
    weight *= (np.abs(away[:, 0]) > SAME_HEADING) | (np.abs(away[:, 1]) > SAME_CLOCK)
    return np.asarray((away * weight[:, None]).T @ away / (1 + weight.sum()))


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
        removed; ``common_heading_std``, ``common_clock_std``, ``common_gain_std`` what uncertainty remains that all
        rows share. They come from the same paths and are no independent knowledge. ``position_heading_std``,
        ``position_clock_std``, ``position_gain_std`` are the errors of single positions; those of their places are in
        the first two.
    """
    removed, remaining = calibration.applied, calibration.remaining
    columns = {"heading": "azimuth", "clock": "delay", "gain": "path_gain"}
    mended = {column: table[column] - removed[name] for name, column in columns.items() if removed[name]}
    # an offset that is roughly known, or different at each position, makes each gain uncertain
    gain_std = float(np.hypot(remaining["gain"] if removed["gain"] else 0.0, calibration.spreads["gain"]))
    if gain_std:
        stated = table["path_gain_std"]
        mended["path_gain_std"] = (stated.fillna(0.0) ** 2 + gain_std**2) ** 0.5
    attributes = {f"{name}_error": removed[name] for name in NAMES}
    attributes |= {f"common_{name}_std": remaining[name] for name in NAMES}
    attributes |= {f"position_{name}_std": calibration.spreads[name] for name in NAMES}
    mended = {column: values.assign_attrs(table[column].attrs) for column, values in mended.items()}
    return table.assign(mended).assign_attrs(attributes)
