"""Description of a verification (TOML): the calibration, and what is known of each artefact."""

import datetime
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from sounder.toml import Decibels, NotNegative, NotNegativeDecibels, Positive, RelativePath, Table, read_toml


class Artefact(Table):
    """A known artefact, and its recordings.

    Attributes
    ----------
    name : str
    kind : {"connected", "link", "reflector"}
        ``connected``: a cable or an attenuator in place of the antennas. ``link``: line of sight between both antennas.
        ``reflector``: a trihedral corner beside whose axis both antennas stand.
    recordings : tuple of path
        Back-to-back recordings of a ``connected`` artefact; recordings of one position otherwise. Several of them,
        after the artefact was disconnected and connected again, give the repeatability.
    s21 : path, optional
        Touchstone file of a connected artefact.
    attenuation : float, optional
        Its loss, if there is no S21 [dB].
    delay : float, optional
        Its delay, if there is no S21 [s]; without both the delay is not verified.
    gain_std, delay_std : float
        Standard deviations of what is known of it [dB], [s].
    distance, distance_std : float
        From antenna to antenna, or from the antennas to the reflector [m].
    side : float, optional
        Length of the inner edges of a triangular trihedral [m].
    """

    name: str
    kind: Literal["connected", "link", "reflector"]
    recordings: Annotated[tuple[RelativePath, ...], Field(min_length=1)]
    s21: RelativePath | None = None
    attenuation: Decibels | None = None
    delay: float | None = None
    gain_std: NotNegativeDecibels = 0.0
    delay_std: NotNegative = 0.0
    distance: Positive | None = None
    distance_std: NotNegative = 0.0
    side: Positive | None = None

    @model_validator(mode="after")
    def _known(self) -> Self:
        if self.kind == "connected" and (self.s21 is None) == (self.attenuation is None):
            raise ValueError(f"{self.name}: a connected artefact needs s21 or attenuation, not both")
        if self.kind != "connected" and self.distance is None:
            raise ValueError(f"{self.name}: a {self.kind} needs distance")
        if (self.kind == "reflector") != (self.side is not None):
            raise ValueError(f"{self.name}: side and kind reflector go together")
        return self


class Verification(Table):
    """A verification of a sounder on one day.

    Attributes
    ----------
    name : str
        Title of the page.
    date : date
    calibration : path
        Back-to-back recording that is used for measurements, and so is verified.
    artefacts : tuple of Artefact
    """

    name: str
    date: datetime.date
    calibration: RelativePath
    artefacts: Annotated[tuple[Artefact, ...], Field(min_length=1)]

    @property
    def inputs(self) -> list[Path]:
        """All files that it names."""
        each = [path for artefact in self.artefacts for path in (*artefact.recordings, artefact.s21) if path]
        return [self.calibration, *each]


def load_verification(path: Path | str) -> Verification:
    """Read the description of a verification. Paths in it are relative to its folder.

    Raises
    ------
    DataError
        The file is missing or not TOML, or has an unknown key or an invalid value.
    """
    return Verification.from_tables(read_toml(path), path, file=Path(path))
