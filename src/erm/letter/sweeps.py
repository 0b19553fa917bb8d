"""Effect of denser positions, finer rotation, narrower beams, more bandwidth and more power, through captures.

Two straight routes of the campaign are measured again with one setting changed at a time, several times with shifted
positions. The reference is always the same: the true single bounces off walls of the densest positions.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from erm.geometry.vertical import FloatArray
from erm.letter.captures import UNCHANGED, Campaign, Captures, Change, Link
from erm.letter.outcome import Located, Outcome, evaluate_setting, root_mean_square, true_points
from erm.letter.replicates import columns, difference, is_significant, mean, standard_error
from erm.letter.routes import study

LINES = (("RX1_L", "RX9_L"), ("RX11_L", "RX16_L"))
"""First and last position of each straight route."""
SPACING = 10.0  # m; between positions where another setting changes
DENSEST = 2.5  # m; between the positions of the reference
OFFSETS = (0.0, 6.0, 13.0)
"""First position of each replicate [m], modulo the spacing. Denser positions include the sparser ones. Chosen."""


@dataclass(frozen=True)
class SweptParameter:
    """A setting of the instrument or the positions, and its values.

    Parameters
    ----------
    name, unit : str
    values : tuple of float
        In order of increasing effort.
    usual : float
        The letter's value.
    change : callable
        Change of the instrument for a value; None if the positions change instead.
    """

    name: str
    unit: str
    values: tuple[float, ...]
    usual: float
    change: Callable[[float], Change] | None


SWEPT_PARAMETERS = (
    SweptParameter("RX spacing", "m", (20.0, 10.0, 5.0, 2.5), SPACING, None),
    SweptParameter("azimuth step", "°", (20.0, 10.0, 5.0, 2.5), 10.0, lambda value: Change(azimuth_step=value)),
    SweptParameter("HPBW", "°", (40.0, 20.0, 10.0, 5.0), 10.0, lambda value: Change(beamwidth=value)),
    SweptParameter("HPBW = step", "°", (10.0, 5.0), 10.0, lambda value: Change(beamwidth=value, azimuth_step=value)),
    SweptParameter("bandwidth", "GHz", (0.3, 0.6, 1.2, 2.4, 4.8), 1.2, lambda value: Change(bandwidth=1e9 * value)),
    SweptParameter("SNR change", "dB", (-30.0, -20.0, -10.0, 0.0, 10.0), 0.0, lambda value: Change(power=value)),
)


@dataclass(frozen=True)
class Sweep:
    """A setting and the results of its values.

    Parameters
    ----------
    parameter : SweptParameter
    outcomes : tuple (value) of tuple (replicate) of Outcome
        The replicates of all values have the same positions as far as the spacing allows.
    """

    parameter: SweptParameter
    outcomes: tuple[tuple[Outcome, ...], ...]

    def of(self, field: str) -> FloatArray:
        """Return a field of the outcomes (value, replicate)."""
        return columns(self.outcomes, field)

    def mean(self, field: str) -> FloatArray:
        """Mean (value,) of a field over the replicates."""
        return np.array([mean(row) for row in self.of(field)])

    def error(self, field: str) -> FloatArray:
        """Standard error (value,) of the mean."""
        return np.array([standard_error(row) for row in self.of(field)])

    @property
    def usual(self) -> int:
        """Index of the letter's value."""
        return self.parameter.values.index(self.parameter.usual)


def along(
    campaign: Campaign, spacing: float, lines: Sequence[tuple[str, str]] = LINES, *, offset: float = 0.0
) -> Campaign:
    """Return the campaign with positions every ``spacing`` [m] along lines, each between two of its positions.

    The first position is ``offset`` modulo ``spacing`` [m] from the beginning of a line. Names contain the distance.
    """
    known = {link.name: link for link in campaign.links}
    links: list[Link] = []
    for first, last in lines:
        start, end = np.array(known[first].rx), np.array(known[last].rx)
        length = float(np.linalg.norm(end - start))
        for place in np.arange(offset % spacing, length + 1e-6, spacing).tolist():
            east, north, up = (start + place / length * (end - start)).tolist()
            links.append(Link(f"{first}+{place:g}", known[first].tx, (east, north, up)))
    return campaign.at(links)


def sweep(
    campaign: Campaign,
    captures: Captures,
    parameters: Sequence[SweptParameter] = SWEPT_PARAMETERS,
    *,
    offsets: Sequence[float] = OFFSETS,
    progress: Callable[[], None] | None = None,
) -> list[Sweep]:
    """Measure with every value of each setting, the others at the letter's values.

    Parameters
    ----------
    captures : Captures
        Settings share positions; `erm.letter.captures.Cached` avoids measuring these again.
    offsets : sequence of float
        Offsets of the replicates [m].
    progress : callable, optional
        Called after each value of each replicate.
    """
    reference = true_points(along(campaign, DENSEST))
    known: dict[tuple[float, float, Change], tuple[Outcome, Located]] = {}
    sweeps = []
    for parameter in parameters:
        rows: list[list[tuple[Outcome, Located]]] = []
        for value in parameter.values:
            rows.append([])
            for offset in offsets:
                spacing, change = (value, UNCHANGED) if parameter.change is None else (SPACING, parameter.change(value))
                if value == parameter.usual:
                    spacing, change = SPACING, UNCHANGED  # the shipped instrument
                setting = (spacing, offset, change)
                if setting not in known:
                    placed = along(campaign, spacing, offset=offset)
                    known[setting] = evaluate_setting(study(placed, captures, change), reference)
                rows[-1].append(known[setting])
                if progress is not None:
                    progress()
        sweeps.append(Sweep(parameter, _with_shared(rows)))
    return sweeps


def _with_shared(rows: Sequence[Sequence[tuple[Outcome, Located]]]) -> tuple[tuple[Outcome, ...], ...]:
    """Outcomes (value) (replicate) with the error of the bounces that were measured with every value."""
    shared = [set.intersection(*(set(located) for _, located in replicate)) for replicate in zip(*rows, strict=True)]
    return tuple(
        tuple(
            replace(outcome, shared_error=root_mean_square(located, of))
            for (outcome, located), of in zip(row, shared, strict=True)
        )
        for row in rows
    )


@dataclass(frozen=True)
class Gain:
    """Largest improvement of a setting beyond the letter's value.

    Parameters
    ----------
    parameter : SweptParameter
    value : float
        Value with the improvement; the letter's value if none is better.
    mean, error : float
        Over the replicates: the increase of completeness, or the factor by which an error shrinks.
    """

    parameter: SweptParameter
    value: float
    mean: float
    error: float


def gains(sweeps: Sequence[Sweep], field: str) -> list[Gain]:
    """Best gain of a field by setting, largest first. ``completeness`` grows, errors shrink."""
    found = []
    for one in sweeps:
        values, usual = one.of(field), one.of(field)[one.usual]
        steps = []
        for value, row in zip(one.parameter.values[one.usual :], values[one.usual :], strict=True):
            gained = row - usual if field == "completeness" else usual / row
            steps.append(Gain(one.parameter, value, mean(gained), standard_error(gained)))
        found.append(max(steps, key=lambda step: -np.inf if np.isnan(step.mean) else step.mean))
    return sorted(found, key=lambda gain: gain.mean, reverse=True)


@dataclass(frozen=True)
class CompletenessDrop:
    """A step of more effort after which a map is significantly less complete.

    Parameters
    ----------
    parameter : SweptParameter
    former, later : float
        Values of the setting before and after the step.
    lost : dict of str to tuple of float
        Mean difference and standard error by field: ``completeness``, ``of_explained``, ``of_corrected``, ``of_exact``.
    """

    parameter: SweptParameter
    former: float
    later: float
    lost: dict[str, tuple[float, float]]


def completeness_drops(sweeps: Sequence[Sweep]) -> list[CompletenessDrop]:
    """Steps of more effort, of all settings, after which completeness falls by more than its scatter."""
    found = []
    fields = ("completeness", "of_explained", "of_corrected", "of_exact")
    for one in sweeps:
        values = {field: one.of(field) for field in fields}
        for i in range(len(one.parameter.values) - 1):
            lost = {field: difference(rows[i + 1], rows[i]) for field, rows in values.items()}
            if lost["completeness"][0] < 0 and is_significant(lost["completeness"]):
                found.append(
                    CompletenessDrop(one.parameter, one.parameter.values[i], one.parameter.values[i + 1], lost)
                )
    return found
