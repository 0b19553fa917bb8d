"""Antennas in a sounder description."""

import math
from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from sounder.toml import MOST_DECIBELS, Decibels, NotNegative, NotNegativeDecibels, Table


class Cut(Table):
    """Principal cuts of an antenna.

    Attributes
    ----------
    angle : tuple of float
        Angles off boresight, ascending, on both sides of 0 [degree].
    azimuth, elevation : tuple of float
        Gain at these angles in the horizontal and in the vertical cut [dB]; the level at 0 is the reference.
    gain : float, optional
        Boresight gain that the file of the cuts states [dBi]. It is compared with that of the antenna.
    """

    angle: tuple[Annotated[float, Field(ge=-360, le=360)], ...]
    azimuth: tuple[Decibels, ...]
    elevation: tuple[Decibels, ...]
    gain: Decibels | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if not len(self.angle) == len(self.azimuth) == len(self.elevation) >= 3:
            raise ValueError("angle, azimuth and elevation must have one length, at least 3")
        if any(b - a < CLOSEST for a, b in pairwise(self.angle)):
            raise ValueError(f"angle must be in ascending order, by {CLOSEST:g} degree or more")
        if not self.angle[0] < 0 < self.angle[-1]:
            raise ValueError("angle must reach to both sides of boresight (0)")
        return self


class Antenna(Table):
    """An antenna: its boresight gain, and how the gain falls off boresight.

    Attributes
    ----------
    gain : float
        Boresight gain [dBi].
    pattern : {"gaussian", "cut", "flat"}
        ``gaussian``: a Gaussian main lobe above a flat sidelobe floor. ``cut``: measured principal cuts. ``flat``: the
        boresight gain in every direction, for an antenna whose pattern is not to be removed.
    hpbw_azimuth, hpbw_elevation : float, optional
        Half-power beamwidths [degree]; needed unless the pattern is flat.
    sidelobe_floor : float
        Lowest gain relative to boresight [dB].
    cut : Cut, optional
        The measured cuts. A description file names a CSV file beside it; see `sounder.instrument.antenna_files`.
    gain_std : float
        Standard deviation of the boresight gain [dB]; part of every ``path_gain_std``.
    gain_error : float, optional
        Relative error of the pattern's amplitude in a beam [1], independent from beam to beam. What is stated is part
        of the errors of MPCs; see :func:`sounder.mpc.stated.pattern_covariance`.
    beamwidth_error : float, optional
        Relative error of the beamwidths [1], the same in all beams.
    margin_above : float
        How far a beam's sidelobes may be above the described pattern [dB]. The default, a factor of 2 in amplitude, is
        assumed, not measured.
    margin_below : float
        How far they may be below it [dB]: a described floor may be a limit, and the real one lower. The default, a
        factor of 4 in amplitude, is assumed, not measured.
    """

    gain: Decibels
    pattern: Literal["gaussian", "cut", "flat"] = "gaussian"
    hpbw_azimuth: Annotated[float, Field(gt=0, le=360)] | None = None
    hpbw_elevation: Annotated[float, Field(gt=0, le=180)] | None = None
    sidelobe_floor: Annotated[float, Field(ge=-MOST_DECIBELS, lt=0)] = -30.0
    cut: Cut | None = None
    gain_std: NotNegativeDecibels = 0.0
    gain_error: NotNegative | None = None
    beamwidth_error: NotNegative | None = None
    margin_above: NotNegativeDecibels = 20 * math.log10(2)
    margin_below: NotNegativeDecibels = 20 * math.log10(4)

    @property
    def pattern_error(self) -> tuple[float, float]:
        """Relative errors of amplitude and beamwidth: as stated, else :data:`ASSUMED_ERROR`."""
        stated = self.gain_error, self.beamwidth_error
        gain, width = (
            given if given is not None else known for given, known in zip(stated, ASSUMED_ERROR, strict=True)
        )
        return gain, width

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.pattern != "flat" and None in (self.hpbw_azimuth, self.hpbw_elevation):
            raise ValueError(f'pattern "{self.pattern}" needs hpbw_azimuth and hpbw_elevation')
        if (self.pattern == "cut") != (self.cut is not None):
            raise ValueError('pattern "cut" and the key cut go together')
        if self.cut is not None:
            if self.cut.gain is not None and abs(self.cut.gain - self.gain) > GAIN_DIFFERENCE:
                raise ValueError(f"gain is {self.gain:g} dBi, but the file of the cut states {self.cut.gain:g} dBi")
            for name, width in (("azimuth", self.hpbw_azimuth), ("elevation", self.hpbw_elevation)):
                _require_main_lobe(self.cut, name, width or math.inf)
        return self


CLOSEST = 1e-6
"""Least distance of the angles of a cut [degree]: far finer than any positioner, and slopes stay numbers. Chosen."""
ASSUMED_ERROR = 0.005, 0.01
"""Errors of an amplitude and a beamwidth that are not stated [1]. Several paths are told from one only as far as the
pattern is known. Assumed, not measured."""
GAIN_DIFFERENCE = 3.0
"""How far the gain that a file states may be from the described one [dB]: a factor of 2. Chosen; not derived."""
WIDTH_RATIO = 3.0
"""How far the half-power width of a cut may be from the described one, either way. A cut with one point a beamwidth
comes out half as wide; linear power or zenith angles have no half-power width at all. Chosen; not derived."""


def _require_main_lobe(cut: Cut, name: str, width: float) -> None:
    """Refuse a cut that does not have its maximum at boresight and the described half-power width."""
    level = getattr(cut, name)
    peak = cut.angle[level.index(max(level))]
    if abs(peak) > width / 2:
        raise ValueError(
            f"the cut in {name} has its maximum at {peak:g} degree; expected it at boresight, 0, in dB of gain"
        )
    half = max(level) - 10 * math.log10(2)
    edges = []
    for side in (1, -1):
        points = [
            (side * angle, value) for angle, value in zip(cut.angle, level, strict=True) if side * angle >= side * peak
        ]
        points.sort()
        crossing = next(((a, b) for a, b in pairwise(points) if b[1] < half <= a[1]), None)
        edges.append(math.inf if crossing is None else _between(*crossing, half))
    measured = sum(edges)
    if not width / WIDTH_RATIO <= measured <= width * WIDTH_RATIO:
        raise ValueError(
            f"the cut in {name} is {measured:.3g} degree wide at half power, but hpbw_{name} is {width:g} degree; "
            "expected gain in dB over the angle off boresight"
        )


def _between(before: tuple[float, float], after: tuple[float, float], level: float) -> float:
    """Angle at which the line from one point (angle, level) to another has a level."""
    return before[0] + (after[0] - before[0]) * (before[1] - level) / (before[1] - after[1])
