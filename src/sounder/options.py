"""Options of processing: what each may be, in one place for functions, campaign files and the command line."""

import math
from dataclasses import dataclass, fields
from typing import Any, Literal, Self, get_args, get_type_hints

from erm.common.errors import OptionError

Averaging = Literal["coherent", "phase-aligned", "power"]
"""How the snapshots of a direction are averaged."""
Method = Literal["sage", "clean", "peaks"]
"""How overlapping MPCs are separated."""
BeamProfile = Literal["sum", "maximum"]
"""How the omnidirectional PDP is made from beams: their sum, or the strongest in each delay bin."""
Omnidirectional = Literal["synthesis", "sum", "maximum"]
"""How the omnidirectional PDP is made: synthesis from the MPCs, or from the beams as `BeamProfile` says."""
Source = Literal["mpcs", "pdp"]
"""What channel parameters are computed from: MPCs, or samples of the omnidirectional PDP."""
Clustering = Literal["none", "k-power-means", "dbscan"]
"""How MPCs are grouped into clusters."""
FigureFormat = Literal["png", "pdf", "svg"]
"""File format of figures."""


@dataclass(frozen=True)
class Threshold:
    """What counts as a path: power over the noise, power under the strongest, and delay.

    The least power is the higher of a level over the noise floor and strongest sample - ``dynamic_range``. The level is
    ``noise_margin`` or, without one, what noise alone exceeds ``false_alarms`` times in a position: it follows from the
    samples, beams and averaging of the scan. Groups differ in these numbers; :data:`THRESHOLDS` has sets by name.

    Attributes
    ----------
    noise_margin : float, optional
        Over the mean noise power of the beam [dB].
    dynamic_range : float
        Under the strongest sample of the position [dB]; infinite: no limit.
    delay_gate : float
        Longest delay [s], as the propagation delay from TX to RX; infinite: no limit.
    false_alarms : float
        False MPCs that noise may make in a position, on average; used without ``noise_margin``.

    Raises
    ------
    OptionError
        A number is negative or not a number, or the delay gate or the rate is 0.

    Examples
    --------
    >>> Threshold.of("nyu").noise_margin, Threshold.of("cfar:0.01").false_alarms
    (5.0, 0.01)
    >>> Threshold.of("10,30,4e-7").delay_gate
    4e-07
    >>> str(Threshold(10.0, 30.0)), str(Threshold(12.0)), str(Threshold(dynamic_range=30.0))
    ('10,30', 'usc', 'cfar,30')
    """

    noise_margin: float | None = None
    dynamic_range: float = math.inf
    delay_gate: float = math.inf
    false_alarms: float = 0.05

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            least = "more than 0" if field.name in ("delay_gate", "false_alarms") else "0 or more"
            if value is not None and (not value >= 0 or (least != "0 or more" and value == 0)):
                raise OptionError(f"threshold: {field.name} is {value:g}; expected {least}")

    @classmethod
    def of(cls, text: "str | Threshold") -> Self:
        """Threshold of a name, or of one to three items with commas between: ``12``, ``10,30,4e-7``, ``cfar:0.01,30``.

        Raises
        ------
        OptionError
            The text is neither.
        """
        if isinstance(text, Threshold):
            return cls(text.noise_margin, text.dynamic_range, text.delay_gate, text.false_alarms)
        if text in THRESHOLDS:
            return cls.of(THRESHOLDS[text])
        try:
            first, *others = text.split(",")
            name, colon, rate = first.partition(":")
            level = {"noise_margin": float(first)} if name != "cfar" else {"false_alarms": float(rate)} if colon else {}
            limits = dict(zip(("dynamic_range", "delay_gate"), map(float, others), strict=False))
        except (AttributeError, ValueError):
            others, level, limits = [], {}, {"none": math.nan}
        if "none" in limits or len(others) > len(limits):
            raise OptionError(
                f"threshold is {text!r}; expected one of {', '.join(THRESHOLDS)}, or numbers: dB over the noise floor, "
                "dynamic range [dB], delay gate [s], as in 10,30,4e-7; for the first also a rate of false MPCs a "
                "position, as in cfar:0.01"
            )
        return cls(**level, **limits)

    def __str__(self) -> str:
        for name, known in THRESHOLDS.items():
            if self == known:
                return name
        rate = "" if self.false_alarms == Threshold.false_alarms else f":{self.false_alarms:.12g}"
        level = f"cfar{rate}" if self.noise_margin is None else f"{self.noise_margin:.12g}"
        numbers = [level, f"{self.dynamic_range:.12g}", f"{self.delay_gate:.12g}"]
        while numbers[-1] == "inf" and len(numbers) > 1:
            numbers.pop()
        return ",".join(numbers)


THRESHOLDS = {"cfar": Threshold(), "usc": Threshold(12.0), "nyu": Threshold(5.0, 25.0)}
"""Thresholds by name. ``cfar``: noise makes 1 false MPC in 20 positions. ``usc``: noise floor + 12 dB (Gomez-Ponce et
al.). ``nyu``: the higher of strongest - 25 dB and noise floor + 5 dB (Sun et al.)."""


@dataclass(frozen=True)
class Options:
    """How recordings are processed. Every product stores its options.

    Attributes
    ----------
    averaging : {"coherent", "phase-aligned", "power"}
        Over the snapshots of a direction; see :func:`sounder.cir.impulse_response.impulse_responses`.
    threshold : str
        What counts as an MPC, as :class:`Threshold` writes it: ``cfar``, ``usc``, ``nyu``, or numbers such as
        ``10,30,4e-7``.
    method : {"sage", "clean", "peaks"}
        How overlapping MPCs are separated; see :func:`sounder.mpc.extract.extract_mpcs`.
    omnidirectional : {"synthesis", "sum", "maximum"}
        How the omnidirectional PDP is made: from the MPCs (:func:`sounder.mpc.omnidirectional_pdp.with_synthesis`), or
        from the beams (:func:`sounder.cir.power_spectrum.daps`).
    keep_cir : bool
        Keep the impulse responses in the product.
    trust_all : bool
        Only report problems of the data; correct nothing, leave out nothing.

    Raises
    ------
    OptionError
        A value is none of these.

    Examples
    --------
    >>> from sounder import Options
    >>> Options(threshold="nyu").method
    'sage'
    >>> Options(threshold="12,40").threshold
    '12,40'
    >>> Options(method="music")
    Traceback (most recent call last):
    erm.common.errors.OptionError: method is 'music'; expected one of sage, clean, peaks
    """

    averaging: Averaging = "coherent"
    threshold: str = "cfar"
    method: Method = "sage"
    omnidirectional: Omnidirectional = "synthesis"
    keep_cir: bool = False
    trust_all: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "threshold", str(Threshold.of(self.threshold)))
        hints = get_type_hints(type(self))
        for field in fields(self):
            if get_args(hints[field.name]):
                require_choice(field.name, getattr(self, field.name), hints[field.name])


def require_choice(name: str, value: str, choices: Any) -> None:
    """Check an option of a stage.

    Parameters
    ----------
    name, value : str
    choices : Literal
        The values it may have.

    Raises
    ------
    OptionError
        It has another.
    """
    if value not in get_args(choices):
        raise OptionError(f"{name} is {value!r}; expected one of {', '.join(get_args(choices))}")
