"""How an antenna is described."""

from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from sounder.toml import Table


class Cut(Table):
    """Principal cuts of an antenna: gain relative to boresight [dB] over the angle off boresight [degree]."""

    angle: tuple[float, ...]
    azimuth: tuple[float, ...]
    elevation: tuple[float, ...]

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if not len(self.angle) == len(self.azimuth) == len(self.elevation) >= 3:
            raise ValueError("angle, azimuth and elevation must have one length, at least 3")
        if any(b <= a for a, b in pairwise(self.angle)):
            raise ValueError("angle must rise")
        if not self.angle[0] < 0 < self.angle[-1]:
            raise ValueError("angle must reach to both sides of boresight (0)")
        return self


class Antenna(Table):
    """An antenna: boresight gain [dBi] and how the gain falls off it.

    ``gaussian`` is a Gaussian main lobe of the given half-power beamwidths [degree] above a flat ``sidelobe_floor``
    [dB]; ``cut`` takes the relative gain from measured principal cuts (in a description file: the name of a CSV file
    beside it with the header ``angle,azimuth,elevation``); ``flat`` is the boresight gain in every direction, for an
    end whose pattern is not to be removed.
    """

    gain: float
    pattern: Literal["gaussian", "cut", "flat"] = "gaussian"
    hpbw_azimuth: Annotated[float, Field(gt=0, le=360)] | None = None
    hpbw_elevation: Annotated[float, Field(gt=0, le=180)] | None = None
    sidelobe_floor: Annotated[float, Field(lt=0)] = -30.0
    cut: Cut | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.pattern != "flat" and None in (self.hpbw_azimuth, self.hpbw_elevation):
            raise ValueError(f'pattern "{self.pattern}" needs hpbw_azimuth and hpbw_elevation')
        if (self.pattern == "cut") != (self.cut is not None):
            raise ValueError('pattern "cut" and the key cut go together')
        return self
