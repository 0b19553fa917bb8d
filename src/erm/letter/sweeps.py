"""What denser positions, finer rotation, sharper beams, more bandwidth and more power bring, through captures.

Two straight routes of the campaign are measured again with one setting changed at a time, each several times over with
positions that begin further along. What is judged by stays the same: the true single bounces off walls of the densest
positions.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from erm.geometry.vertical import FloatArray
from erm.letter.captures import AS_IT_IS, Campaign, Captures, Change, Link
from erm.letter.outcome import Located, Outcome, judged, root_mean_square, true_points
from erm.letter.replicates import columns, difference, is_clear, mean, standard_error
from erm.letter.routes import study

LINES = (("RX1_L", "RX9_L"), ("RX11_L", "RX16_L"))
"""First and last position of each straight route."""
SPACING = 10.0  # m, of the positions where the spacing is not what changes
DENSEST = 2.5  # m
OFFSETS = (0.0, 6.0, 13.0)
"""Where the positions of each replicate begin [m], modulo the spacing: closer positions hold the sparser ones."""


@dataclass(frozen=True)
class Knob:
    """A setting and its values.

    Parameters
    ----------
    name, unit : str
    values : tuple of float
        In the order of growing effort.
    usual : float
        The letter's.
    change : callable
        Instrument with a value; None where the positions change instead.
    """

    name: str
    unit: str
    values: tuple[float, ...]
    usual: float
    change: Callable[[float], Change] | None


KNOBS = (
    Knob("RX spacing", "m", (20.0, 10.0, 5.0, 2.5), SPACING, None),
    Knob("azimuth step", "°", (20.0, 10.0, 5.0, 2.5), 10.0, lambda value: Change(azimuth_step=value)),
    Knob("HPBW", "°", (40.0, 20.0, 10.0, 5.0), 10.0, lambda value: Change(beamwidth=value)),
    Knob("HPBW = step", "°", (10.0, 5.0), 10.0, lambda value: Change(beamwidth=value, azimuth_step=value)),
    Knob("bandwidth", "GHz", (0.3, 0.6, 1.2, 2.4, 4.8), 1.2, lambda value: Change(bandwidth=1e9 * value)),
    Knob("SNR change", "dB", (-30.0, -20.0, -10.0, 0.0, 10.0), 0.0, lambda value: Change(power=value)),
)


@dataclass(frozen=True)
class Sweep:
    """A knob and what its values gave.

    Parameters
    ----------
    knob : Knob
    outcomes : tuple (value) of tuple (replicate) of Outcome
        Replicates of all values stand at the same places as far as the spacing lets them.
    """

    knob: Knob
    outcomes: tuple[tuple[Outcome, ...], ...]

    def of(self, field: str) -> FloatArray:
        """A field of the outcomes (value, replicate)."""
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
        return self.knob.values.index(self.knob.usual)


def along(
    campaign: Campaign, spacing: float, lines: Sequence[tuple[str, str]] = LINES, *, offset: float = 0.0
) -> Campaign:
    """The campaign with positions every ``spacing`` [m] along lines between two of its positions each.

    The first of a line stands ``offset`` modulo ``spacing`` [m] after its beginning; names tell where each stands.
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
    knobs: Sequence[Knob] = KNOBS,
    *,
    offsets: Sequence[float] = OFFSETS,
    progress: Callable[[], None] | None = None,
) -> list[Sweep]:
    """Turn every knob through its values, the others at the letter's.

    Parameters
    ----------
    captures : Captures
        Settings share positions; `erm.letter.captures.Remembered` spares measuring these again.
    offsets : sequence of float
        Of the replicates [m].
    progress : callable, optional
        Called after each value of each replicate.
    """
    reference = true_points(along(campaign, DENSEST))
    known: dict[tuple[float, float, Change], tuple[Outcome, Located]] = {}
    sweeps = []
    for knob in knobs:
        rows: list[list[tuple[Outcome, Located]]] = []
        for value in knob.values:
            rows.append([])
            for offset in offsets:
                spacing, change = (value, AS_IT_IS) if knob.change is None else (SPACING, knob.change(value))
                if value == knob.usual:
                    spacing, change = SPACING, AS_IT_IS  # the shipped instrument itself
                setting = (spacing, offset, change)
                if setting not in known:
                    placed = along(campaign, spacing, offset=offset)
                    known[setting] = judged(study(placed, captures, change), reference)
                rows[-1].append(known[setting])
                if progress is not None:
                    progress()
        sweeps.append(Sweep(knob, _with_shared(rows)))
    return sweeps


def _with_shared(rows: Sequence[Sequence[tuple[Outcome, Located]]]) -> tuple[tuple[Outcome, ...], ...]:
    """Outcomes (value) (replicate) with the error of the bounces that every value of a replicate measured."""
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
    """What more effort than the letter's brings at best.

    Parameters
    ----------
    knob : Knob
    value : float
        That brings it; the letter's where nothing more brings more.
    mean, error : float
        Over the replicates: of completeness what is added, of errors the factor by which they shrink.
    """

    knob: Knob
    value: float
    mean: float
    error: float


def gains(sweeps: Sequence[Sweep], field: str) -> list[Gain]:
    """By knob, most first, the best gain of a field; ``completeness`` grows, errors shrink."""
    found = []
    for one in sweeps:
        values, usual = one.of(field), one.of(field)[one.usual]
        steps = []
        for value, row in zip(one.knob.values[one.usual :], values[one.usual :], strict=True):
            brought = row - usual if field == "completeness" else usual / row
            steps.append(Gain(one.knob, value, mean(brought), standard_error(brought)))
        found.append(max(steps, key=lambda step: -np.inf if np.isnan(step.mean) else step.mean))
    return sorted(found, key=lambda gain: gain.mean, reverse=True)


@dataclass(frozen=True)
class Setback:
    """A step of more effort after which a map is clearly less complete.

    Parameters
    ----------
    knob : Knob
    former, later : float
        Values of the knob.
    lost : dict of str to tuple of float
        Mean difference and standard error by field: ``completeness``, ``of_known``, ``of_honest``, ``of_exact``.
    """

    knob: Knob
    former: float
    later: float
    lost: dict[str, tuple[float, float]]


def setbacks(sweeps: Sequence[Sweep]) -> list[Setback]:
    """Steps of more effort, of all knobs, after which completeness falls by more than its scatter."""
    found = []
    fields = ("completeness", "of_known", "of_honest", "of_exact")
    for one in sweeps:
        values = {field: one.of(field) for field in fields}
        for i in range(len(one.knob.values) - 1):
            lost = {field: difference(rows[i + 1], rows[i]) for field, rows in values.items()}
            if lost["completeness"][0] < 0 and is_clear(lost["completeness"]):
                found.append(Setback(one.knob, one.knob.values[i], one.knob.values[i + 1], lost))
    return found
