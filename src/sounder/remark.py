"""Remarks: what is wrong with a recording, where, by how much, what it means and what to do."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

MAX_NAMED_DIRECTIONS = 3
"""Directions that a line names; it counts the others. Chosen; not derived."""


class Meaning(NamedTuple):
    """What a code stands for."""

    text: str
    """What is wrong, in a few words."""
    action: str
    """What was done about it, or is to be done."""
    advice: bool = False
    """Whether the action is left to the user."""
    unit: str = "1"
    """Unit of figure and bound."""
    fails: bool = True
    """Whether it is a failure of the data (exit code 1), not a note."""
    leaves_out: bool = False
    """Whether the direction is left out of DAPS and MPCs."""
    doubts: tuple[str, ...] = ()
    """Quantities of all MPCs of the position that it makes doubtful: columns of the MPC table."""
    of_calibration: bool = False
    """Whether it concerns the back-to-back recording, and so every position that it calibrates."""


class Code(Enum):
    """Every kind of remark, with its meaning."""

    ALL_ZERO = Meaning("all samples are zero", "left out", leaves_out=True)
    NOT_FINITE = Meaning("samples are NaN, infinite or huge", "left out", leaves_out=True)
    CLIPPED = Meaning("samples are clipped", "left out; lower the receiver gain", leaves_out=True)
    COMPRESSED = Meaning(
        "samples are compressed: their amplitudes pile up at a limit",
        "left out; lower the receiver gain",
        leaves_out=True,
    )
    DEAD = Meaning("noise only, far more than in other directions", "left out", unit="dB", leaves_out=True)
    NOISY = Meaning("more noise than in other directions", "left out", unit="dB", leaves_out=True)
    NOISE_LOW = Meaning(
        "less noise than the receiver has: its gain is not the stated one, or the samples are compressed",
        "left out",
        unit="dB",
        leaves_out=True,
    )
    REPEATED = Meaning("captures repeat those of an earlier direction", "left out", leaves_out=True)
    TONE = Meaning("a tone stands out of the spectrum", "left out", unit="dB", leaves_out=True)
    SNAPSHOTS_SHIFTED = Meaning("snapshots are shifted: samples were lost", "shifted back", unit="sample", fails=False)
    BURST = Meaning("a snapshot holds a burst of noise", "averaged without it", unit="dB", fails=False)
    SAMPLES_LOST = Meaning(
        "samples were lost during the scan",
        "this and all later directions are shifted back",
        unit="sample",
        fails=False,
    )
    SLIPPED = Meaning("the direction is shifted against others", "shifted back", unit="sample", fails=False)
    INCONSISTENT = Meaning(
        "paths of the neighbouring directions are missing here, or its paths are missing in all of them",
        "left out",
        unit="dB",
        leaves_out=True,
    )
    UNSETTLED = Meaning(
        "other directions are shifted, and whether this one is cannot be decided: it has no path at their delays",
        "left out",
        unit="sample",
        leaves_out=True,
    )
    CLOCK_DRIFT = Meaning("the clock drifts over the scan", "removed", unit="ns", fails=False)
    GAIN_SIGN = Meaning(
        "noise floors agree with receiver gains of the opposite sign only", "the sign is changed", unit="dB"
    )
    GAIN_DRIFT = Meaning("the gain changes during the scan, as the noise shows", "removed", unit="dB", fails=False)
    DIRECTIONS_MISSING = Meaning("directions are missing", "processed without them", fails=False)
    TABLE_FULL = Meaning("more paths than an MPC table holds", "the weakest are left out", fails=False)
    PHASE_DRIFT = Meaning(
        "the phase drifts between snapshots: coherent averaging loses power of the strongest direction",
        "try --averaging phase-aligned",
        advice=True,
        fails=False,
    )
    CHANNEL_CHANGES = Meaning(
        "the channel changes between snapshots: phase-aligned averaging loses power of the strongest direction",
        "try --averaging power",
        advice=True,
        fails=False,
    )
    OVER_FREE_SPACE = Meaning(
        "an MPC has more gain than free space allows",
        "check the positions of TX and RX, the calibration and the antenna gains; do not trust the product",
        advice=True,
        unit="dB",
    )

    LOS_DELAY = Meaning(
        "the delay of the direct path does not agree with the distance between TX and RX",
        "check trigger, clock, back-to-back and positions",
        advice=True,
        unit="s",
        doubts=("delay",),
    )
    NO_CLOCK = Meaning(
        "transmitter and receiver share no clock, and the first arrival may not be the direct path",
        "its MPCs are not used for the map; if there is line of sight, set los = 1",
        doubts=("position",),
        fails=False,
    )
    LOS_DIRECTION = Meaning(
        "the direct path does not come from the transmitter",
        "check the zeros of the turntable and the positions",
        advice=True,
        unit="degree",
        doubts=("azimuth",),
    )
    LOS_LEVEL = Meaning(
        "the direct path does not have the gain of free space",
        "check attenuator, scale_factor, agc_gain and antenna gains, and where the transmit antenna points",
        advice=True,
        unit="dB",
        doubts=("path_gain",),
    )
    LOS_ABSENT = Meaning(
        "no direct path is found, though los says line of sight",
        "check los, positions, agc_gain and the scan",
        advice=True,
        doubts=("azimuth",),
    )
    QUADRATURE_EXCHANGED = Meaning(
        "I and Q are exchanged, or Q has the wrong sign, in the recording or in its back-to-back",
        "exchange them in one of the two",
        advice=True,
        doubts=("position",),
    )
    QUADRATURE_DELAYED = Meaning(
        "I and Q are a sample apart in the recording or in its back-to-back",
        "export both again with I and Q of the same instant",
        advice=True,
        doubts=("position",),
    )
    NOISE_LEVEL = Meaning(
        "the noise does not have the level of the noise figure",
        "check scale_factor, agc_gain and receiver.noise_figure",
        advice=True,
        unit="dB",
        doubts=("path_gain",),
    )
    PATTERN_COARSE = Meaning(
        "rows of an antenna's cut are too far apart for the stated pattern",
        "give a finer cut, or state the gain_error of the antenna",
        advice=True,
        unit="dB",
        fails=False,
    )
    BACK_TO_BACK_SLIPPED = Meaning(
        "some back-to-back snapshots are shifted against the others", "left out", fails=True, of_calibration=True
    )
    BACK_TO_BACK_LIMITED = Meaning(
        "the back-to-back samples are clipped or limited: many have the same largest value",
        "record it with less gain",
        advice=True,
        doubts=("path_gain",),
        of_calibration=True,
    )
    BACK_TO_BACK_COMPRESSED = Meaning(
        "the back-to-back holds products of compression",
        "record it with more attenuation",
        advice=True,
        unit="dB",
        of_calibration=True,
    )
    BACK_TO_BACK_PATHS = Meaning(
        "the back-to-back holds more than one path",
        "check its cables, and that no antenna is connected",
        advice=True,
        unit="dB",
        of_calibration=True,
    )
    BACK_TO_BACK_LEVEL = Meaning(
        "the back-to-back does not have the stated level",
        "check attenuation, scale_factor and transmitter.power",
        advice=True,
        unit="dB",
        doubts=("path_gain",),
        of_calibration=True,
    )
    BACK_TO_BACK_DELAY = Meaning(
        "the back-to-back does not have the stated delay",
        "check trigger and cables",
        advice=True,
        unit="s",
        doubts=("delay",),
        of_calibration=True,
    )
    ATTENUATOR = Meaning(
        "the attenuator of the back-to-back is not passive or not the stated one",
        "check attenuation and S21",
        advice=True,
        doubts=("path_gain",),
        of_calibration=True,
    )

    @property
    def text(self) -> str:
        """What is wrong, in a few words."""
        return self.value.text

    @property
    def action(self) -> str:
        """What was done about it, or is to be done."""
        return self.value.action

    @property
    def label(self) -> str:
        """Name in files: ``all-zero``."""
        return self.name.lower().replace("_", "-")


@dataclass(frozen=True)
class Remark:
    """One thing that is wrong with a position, one of its directions, or one snapshot of a direction.

    Attributes
    ----------
    code : Code
        What is wrong.
    azimuth, elevation : float
        Direction [degree]; NaN for the whole position.
    snapshot : int
        Number of the first snapshot concerned; -1 for all.
    figure, bound : float
        The measured figure and the bound that it broke, in ``code.value.unit``; NaN if there is none.
    detail : str
        What is wrong with its figures, if more is to be said than ``code.text``.

    Examples
    --------
    >>> remark = Remark(Code.CLIPPED, azimuth=10.0, elevation=0.0, figure=0.02, bound=0.001)
    >>> remark.meaning
    'samples are clipped'
    """

    code: Code
    azimuth: float = math.nan
    elevation: float = math.nan
    snapshot: int = -1
    figure: float = math.nan
    bound: float = math.nan
    detail: str = ""

    @property
    def meaning(self) -> str:
        """What is wrong, in words."""
        return self.detail or self.code.text

    @property
    def of_direction(self) -> bool:
        """Whether it concerns one direction, not the whole position."""
        return math.isfinite(self.azimuth)


def doubts(remarks: Iterable[Remark]) -> list[str]:
    """Columns of the MPC table that remarks make doubtful, each once."""
    return list(dict.fromkeys(quantity for remark in remarks for quantity in remark.code.value.doubts))


def lines(remarks: Sequence[Remark], recorded: int, *, failures: bool) -> list[str]:
    """One line for each kind of failure, or of note, in a position.

    Parameters
    ----------
    remarks : sequence of Remark
        All remarks of the position.
    recorded : int
        Its recorded directions.
    failures : bool
        Lines of failures; otherwise of notes.

    Examples
    --------
    >>> zero = [Remark(Code.ALL_ZERO, azimuth=10.0 * k, elevation=0.0) for k in range(5)]
    >>> lines(zero, 108, failures=True)
    ['all samples are zero in 5 of 108 directions: (azimuth, elevation) (0, 0), (10, 0), (20, 0) and 2 more; left out']
    """
    kinds: dict[tuple[Code, str], list[Remark]] = {}
    for remark in remarks:
        if remark.code.value.fails == failures:
            kinds.setdefault((remark.code, remark.detail), []).append(remark)
    return [_line(alike, recorded) for alike in kinds.values()]


def _line(alike: Sequence[Remark], recorded: int) -> str:
    """One kind of remark, with the directions that have it."""
    first = alike[0]
    if not first.of_direction:
        extent = "" if first.detail else _extent(alike)  # the detail has its figures
        return f"{first.meaning}{extent}{':' if first.code.value.advice else ';'} {first.code.action}"
    directions = list(dict.fromkeys((remark.azimuth, remark.elevation) for remark in alike))
    where = named(directions)
    return (
        f"{first.meaning}{_extent(alike)} in {len(directions)} of {recorded} directions: {where}; {first.code.action}"
    )


def _extent(alike: Sequence[Remark]) -> str:
    """Largest figure of remarks, in brackets; empty if they have none."""
    figures = [remark.figure for remark in alike if math.isfinite(remark.figure)]
    if not figures:
        return ""
    worst, unit = max(figures, key=abs), alike[0].code.value.unit
    return f" (up to {100 * worst:.1f} %)" if unit == "1" else f" (up to {worst:.3g} {unit})"


def named(directions: Iterable[tuple[float, float]]) -> str:
    """Name the first directions (azimuth, elevation) [degree] and count the others."""
    every = list(directions)
    shown = ", ".join(f"({a:g}, {e:g})" for a, e in every[:MAX_NAMED_DIRECTIONS])
    more = f" and {len(every) - MAX_NAMED_DIRECTIONS} more" if len(every) > MAX_NAMED_DIRECTIONS else ""
    return f"(azimuth, elevation) {shown}{more}"
