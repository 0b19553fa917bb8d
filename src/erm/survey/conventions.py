"""Conventions of a table that is not written as expected: radians, compass bearings, losses, gigahertz, feet.

Direct paths are known from the places of the antennas: their length, azimuth, elevation and gain. Each convention is a
change of the table. Changes under which direct paths agree far better than as given are named, never applied. Common
errors of heading, clock and gain are free for the table as given and for the changed one alike, with the same priors,
so that a heading that is off by 20 degrees is no convention.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from erm.common.constants import c
from erm.geometry.vertical import FloatArray
from erm.mpcs.selection import ELEVATION_STD
from erm.mpcs.standard_errors import ASSUMED, SMALLEST_ERRORS
from erm.mpcs.table import free_space_gain
from erm.survey.direct_paths import (
    LEAST_EVIDENCE,
    SPREADS,
    USUAL_CLOCK,
    USUAL_HEADING,
    DirectPaths,
    direct_paths_at,
    find_direct_paths,
    latest_clock,
    one_sided_evidence,
)
from erm.survey.gains import CLEAR_STD, offset_likelihood
from erm.survey.observations import Observations
from erm.survey.sharpness import Sharpness

if TYPE_CHECKING:
    import xarray as xr

MARGIN = 5.0
"""Log-likelihood ratio beyond which a convention is named: 150 to 1, ten times the number of conventions."""
TIED = 3.0
"""Log-likelihood within which conventions are named together: 20 to 1."""
FEWEST = 2.5
"""Fewest direct paths behind a convention: three that are likely. Two agree by chance on clock and heading."""
MOST_CHANGES = 4
"""Most conventions that are wrong at a time."""
MAX_LINKS = 25
"""Antenna pairs that are looked at; chosen for time."""


LOWEST_FREQUENCY, UNUSUAL = 1e6, -7.0
"""Frequency [Hz] below which hardly any channel is sounded, and the log of the share of tables that do: 1 in 1000."""
MANY = 8.0
"""Common errors up to this many usual ones are no reason to look for another convention: 40 degrees, 27 ns."""


class _Convention(NamedTuple):
    text: str
    change: Callable[[Observations], Observations]
    geometric: bool = True
    """Whether it changes length, azimuth or places of direct paths."""
    searched: bool = True
    """Whether it changes which paths are direct: elevations tell too."""


@dataclass(frozen=True)
class Cause:
    """Conventions that would make direct paths agree with a table."""

    conventions: tuple[str, ...]
    """What the table may hold; each of them agrees about as well."""
    evidence: float
    """Log-likelihood ratio to the table as given, or with the causes before."""
    direct_paths: int
    """Number of antenna pairs with a direct path when all causes are taken together."""
    links: int
    """Number of antenna pairs that were looked at."""

    @property
    def text(self) -> str:
        """One line for people."""
        return (
            f"{', or '.join(self.conventions)}: the direct paths of {self.direct_paths} of {self.links} antenna pairs "
            f"then agree with the places of the antennas far better than as given (log-likelihood ratio "
            f"{self.evidence:.0f})"
        )


def _scaled_places(seen: Observations, factor: float) -> Observations:
    return replace(seen, tx=seen.tx * factor, rx=seen.rx * factor)


def _scaled_delays(seen: Observations, factor: float) -> Observations:
    # an error that would be shorter than anything measured was assumed, not given in this unit
    std = np.where(seen.length_std * factor < SMALLEST_ERRORS[0] * c, seen.length_std, seen.length_std * factor)
    return replace(seen, length=seen.length * factor, length_std=std)


def _degrees_of_std(std: FloatArray) -> FloatArray:
    """Standard errors of angles in radians, in degrees; assumed ones are in degrees."""
    return np.minimum(np.rad2deg(std), np.maximum(std, ASSUMED.azimuth))


CONVENTIONS = (
    _Convention(
        "azimuth in radians instead of degrees",
        lambda t: replace(t, azimuth=np.rad2deg(t.azimuth), azimuth_std=_degrees_of_std(t.azimuth_std)),
    ),
    _Convention("azimuth as compass bearing (clockwise from north)", lambda t: replace(t, azimuth=90 - t.azimuth)),
    _Convention("azimuth mirrored (clockwise from east)", lambda t: replace(t, azimuth=-t.azimuth)),
    _Convention("delay in nanoseconds instead of seconds", lambda t: _scaled_delays(t, 1e-9)),
    _Convention("delay in microseconds instead of seconds", lambda t: _scaled_delays(t, 1e-6)),
    _Convention("positions in feet instead of metres", lambda t: _scaled_places(t, 0.3048)),
    _Convention("TX and RX exchanged", lambda t: replace(t, tx=t.rx, rx=t.tx)),
    _Convention("east and north exchanged", lambda t: replace(t, tx=t.tx[:, [1, 0, 2]], rx=t.rx[:, [1, 0, 2]])),
    _Convention(
        "elevation in radians instead of degrees",
        lambda t: replace(t, elevation=np.rad2deg(t.elevation), elevation_std=_degrees_of_std(t.elevation_std)),
        geometric=False,
    ),
    _Convention("elevation with the opposite sign", lambda t: replace(t, elevation=-t.elevation), geometric=False),
    _Convention("elevation as zenith angle", lambda t: replace(t, elevation=90 - t.elevation), geometric=False),
    _Convention("path_gain as loss (positive)", lambda t: replace(t, gain=-t.gain), geometric=False, searched=False),
    _Convention(
        "frequency in GHz instead of Hz",
        lambda t: replace(t, frequency=t.frequency * 1e9),
        geometric=False,
        searched=False,
    ),
    _Convention(
        "frequency in MHz instead of Hz",
        lambda t: replace(t, frequency=t.frequency * 1e6),
        geometric=False,
        searched=False,
    ),
)


def contradictions(table: "xr.Dataset") -> list[Cause]:
    """Find conventions that would make direct paths agree far better with a table than as given.

    Parameters
    ----------
    table : xarray.Dataset
        MPC table (`erm.make_table`).

    Returns
    -------
    list of Cause
        In the order of their evidence; each one is found with those before it. Empty where the table agrees as it is,
        and where no direct path was received.

    Examples
    --------
    >>> import erm, xarray as xr
    >>> from erm.survey.conventions import contradictions
    >>> street = erm.Environment.walls([[[-60, 10], [60, 10]]], top=40.0)
    >>> links = [erm.predict(street, (0, 0, 9), (x, x / 3 - 9, 2), 132e9) for x in range(10, 40, 4)]
    >>> table = xr.concat(links, dim="mpc")
    >>> contradictions(table)
    []
    >>> contradictions(table.assign(azimuth=90 - table["azimuth"]))[0].conventions
    ('azimuth as compass bearing (clockwise from north)', 'east and north exchanged')
    """
    seen = _fewer_links(Observations.of(table))
    causes: list[Cause] = []
    current, untried = _agreement(seen), list(CONVENTIONS)
    while len(causes) < MOST_CHANGES and untried:
        tried = []
        for convention in untried:
            if convention.geometric and current.usual:
                continue
            changed = convention.change(seen)
            agreement = _agreement(changed, None if convention.searched else current.direct)
            tried.append((agreement, changed, convention))
        best = max(agreement.evidence for agreement, _, _ in tried)
        if best < current.evidence + MARGIN:
            break
        tied = [one for one in tried if one[0].evidence > best - TIED]
        gained = best - current.evidence
        untried = [one for one in untried if one not in [convention for _, _, convention in tied]]
        changed = tied[0][1]
        if any(one.geometric for _, _, one in tied) and _with_images(changed) < _with_images(seen) + MARGIN:
            continue
        seen = changed
        current = _agreement(seen)
        names = tuple(convention.text for _, _, convention in tied)
        causes.append(Cause(names, gained, round(current.number), len(seen.tx)))
    if not current.believable:
        return []
    return [replace(cause, direct_paths=round(current.number)) for cause in causes]


def offsets(table: "xr.Dataset", names: Collection[str]) -> list[Cause]:
    """Heading and clock on which few direct paths agree far better than as given.

    Parameters
    ----------
    table : xarray.Dataset
        MPC table.
    names : collection of str
        Errors to look for: those that `erm.survey.calibration.calibrate` leaves ambiguous.
    """
    seen = _fewer_links(Observations.of(table))
    found = find_direct_paths(seen, most=1)
    if not found or not _Agreement(found[0].evidence, found[0]).believable:
        return []
    best = found[0]
    given = direct_paths_at(seen, 0.0, 0.0, (best.clock_spread, best.heading_spread))
    gained = best.evidence - max(given.evidence, 0.0)
    errors = {
        "heading": (best.heading, USUAL_HEADING / MANY, f"azimuth {best.heading:+.1f} degrees off"),
        "clock": (best.clock, USUAL_CLOCK / MANY, f"delay {best.clock / c * 1e9:+.2f} ns off"),
    }
    wrong = tuple(text for name, (value, least, text) in errors.items() if name in names and abs(value) > least)
    return [Cause((text,), gained, round(best.number), len(seen.tx)) for text in wrong if gained > MARGIN]


class _Agreement(NamedTuple):
    """How well direct paths agree with a table."""

    evidence: float
    direct: DirectPaths | None

    @property
    def number(self) -> float:
        return self.direct.number if self.direct is not None else 0.0

    @property
    def believable(self) -> bool:
        return self.number >= FEWEST and self.evidence > LEAST_EVIDENCE * self.number

    @property
    def usual(self) -> bool:
        """Whether direct paths agree within the errors that surveys have."""
        direct = self.direct
        return (
            self.believable
            and direct is not None
            and abs(direct.heading) < MANY * USUAL_HEADING
            and abs(direct.clock) < MANY * USUAL_CLOCK
            and direct.heading_spread < USUAL_HEADING
            and direct.clock_spread < USUAL_CLOCK
        )


def _agreement(seen: Observations, direct: DirectPaths | None = None) -> _Agreement:
    """Evidence of direct paths by length, azimuth, elevation and gain."""
    if direct is None:
        found = find_direct_paths(seen, most=1)
        direct = found[0] if found else None
        if direct is None:
            return _Agreement(0.0, None)
        if direct.number < FEWEST or direct.evidence < LEAST_EVIDENCE * direct.number:
            alone = one_sided_evidence(seen)
            if direct.evidence < alone:
                return _Agreement(alone + _frequency_prior(seen), None)
    likely = direct.weight > 0.5
    return _Agreement(
        direct.evidence
        + _elevation_evidence(seen, direct, likely)
        + _gain_evidence(seen, direct, likely)
        + _frequency_prior(seen),
        direct,
    )


def _with_images(seen: Observations) -> float:
    """Evidence of direct paths and of mirror images together, at the heading and clock where it is largest.

    Without direct paths, in a street alike on both sides, first reflections agree as mirrored direct paths would. Then
    images agree better as given; of a table that is mirrored they agree less.
    """
    best = 0.0
    for spreads in SPREADS[:2]:
        sharpness = Sharpness(seen, *spreads)
        tried = [(peak.clock, peak.heading) for peak in sharpness.search(latest_clock(seen))]
        tried += [(one.clock, one.heading) for one in find_direct_paths(seen, most=1)]
        for clock, heading in tried:
            direct = direct_paths_at(seen, clock, heading, spreads)
            best = max(best, sharpness.evidence(direct.clock, direct.heading) + direct.evidence)
    return best


def _frequency_prior(seen: Observations) -> float:
    """Log of the prior probability of the frequency: channels are hardly ever sounded below 1 MHz."""
    return UNUSUAL if np.median(seen.frequency) < LOWEST_FREQUENCY else 0.0


def _elevation_evidence(seen: Observations, direct: DirectPaths, likely: npt.NDArray[np.bool_]) -> float:
    """Log-likelihood ratio of the elevations of direct paths to elevations that are uniform over those of the table."""
    known = likely & np.isfinite(seen.elevation)
    if not known.any():
        return 0.0
    extent = np.nanmax(seen.elevation) - np.nanmin(seen.elevation) + 10 * ELEVATION_STD
    std = np.hypot(seen.elevation_std, ELEVATION_STD)[known]
    deviation = seen.elevation[known] - seen.direct_elevation[seen.link[known]]
    density = np.exp(-((deviation / std) ** 2) / 2) / (std * np.sqrt(2 * np.pi))
    return float(np.log(0.1 + 0.9 * density * extent).sum())


def _gain_evidence(seen: Observations, direct: DirectPaths, likely: npt.NDArray[np.bool_]) -> float:
    """Log-likelihood ratio of the gains of direct paths to gains that are uniform over those of the table.

    Direct paths have the gain of free space, plus an offset that all share, less what obstructs them.
    """
    known = likely & np.isfinite(seen.gain) & (seen.length > direct.clock)
    if np.count_nonzero(known) < 2:
        return 0.0
    extent = np.nanmax(seen.gain) - np.nanmin(seen.gain) + 10 * CLEAR_STD
    excess = seen.gain[known] - free_space_gain(seen.length[known] - direct.clock, seen.frequency[known])
    return float((np.log(extent) * len(excess) + offset_likelihood(excess)).max())


def _fewer_links(seen: Observations) -> Observations:
    """At most `MAX_LINKS` antenna pairs, evenly chosen."""
    links = len(seen.tx)
    if links <= MAX_LINKS:
        return seen
    return seen.of_links(np.linspace(0, links - 1, MAX_LINKS).astype(int))
