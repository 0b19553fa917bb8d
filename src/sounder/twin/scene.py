"""A scene to be simulated: environment, positions, sounder and its faults; read from a TOML file."""

import re
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from erm.common.constants import FARTHEST
from erm.common.errors import DataError
from erm.common.gate.limits import current, too_large
from sounder import shipped
from sounder.instrument.description import Sounder, load_sounder
from sounder.toml import Alternatives, NotNegativeDecibels, Positive, RelativePath, Table, read_toml
from sounder.twin.faults import Faults

Coordinate = Annotated[float, Field(gt=-FARTHEST, lt=FARTHEST)]
Position = tuple[Coordinate, Coordinate, Coordinate]
Point = tuple[Coordinate, Coordinate]
Unbounded = Annotated[float, Field(allow_inf_nan=True)]


class _Vertical(Table):
    """A vertical reflector between the heights ``base`` and ``top`` [m]."""

    base: Unbounded = 0.0
    top: Unbounded = float("inf")

    @model_validator(mode="after")
    def _consistent_heights(self) -> Self:
        if not self.base < self.top:
            raise ValueError(f"top is {self.top:g} m; expected more than base, {self.base:g} m")
        return self


class Wall(_Vertical):
    """Vertical walls along a line of points.

    Attributes
    ----------
    points : tuple of (float, float)
        [m]
    closed : bool
        Whether a wall joins the last point to the first.
    base, top : float
        Heights of the lower and the upper edge [m].
    material : str
        Name of a material.
    """

    points: Annotated[tuple[Point, ...], Field(min_length=2)]
    closed: bool = False
    material: str = "concrete"

    @property
    def segments(self) -> list[tuple[Point, Point]]:
        """End points of each straight piece."""
        points = (*self.points, self.points[0]) if self.closed else self.points
        return list(pairwise(points))

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if twice := [a for a, b in self.segments if a == b]:
            raise ValueError(
                f"points hold {list(twice[0])} twice in a row; leave one out (the key closed joins the ends)"
            )
        return self


class Pole(_Vertical):
    """A vertical cylinder.

    Attributes
    ----------
    position : (float, float)
        Centre [m].
    radius : float
        [m]
    base, top : float
        Heights of the lower and the upper end [m].
    material : str
        Name of a material.
    """

    position: Point
    radius: Positive
    material: str = "metal"


class Slab(Table):
    """An infinite horizontal plane: ground or ceiling.

    Attributes
    ----------
    height : float
        [m]
    material : str
        Name of a material.
    """

    height: float
    material: str


class SceneEnvironment(Table):
    """The environment of a scene: a file, or walls, poles, ground and ceiling drawn in the scene.

    Attributes
    ----------
    file : Path, optional
        An environment for :func:`erm.read_map`; always in the frame east/north.
    walls : tuple of Wall
    poles : tuple of Pole
    ground, ceiling : Slab, optional
    materials : dict
        Properties of further materials by name; see :class:`erm.maps.materials.Material`.
    """

    file: RelativePath | None = None
    walls: tuple[Wall, ...] = ()
    poles: tuple[Pole, ...] = ()
    ground: Slab | None = None
    ceiling: Slab | None = None
    materials: dict[str, dict[str, Any]] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        drawn = {name for name in ("walls", "poles", "ground", "ceiling", "materials") if getattr(self, name)}
        if self.file and drawn:
            raise ValueError(f"file and {', '.join(sorted(drawn))} are both given; expected one of them")
        if self.ground and self.ceiling and not self.ground.height < self.ceiling.height:
            heights = self.ceiling.height, self.ground.height
            raise ValueError("ceiling.height is {:g} m; expected more than ground.height, {:g} m".format(*heights))
        return self


class Receiver(Table):
    """A position of the receiver.

    Attributes
    ----------
    name : str
        Name of the position and of its file.
    tx : str
        Name of the transmitter.
    position : (float, float, float)
        [m]
    los : bool, optional
        Whether the transmitter is in line of sight. The environment must agree.
    """

    name: str
    tx: str
    position: Position
    los: bool | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if not re.fullmatch(r"[\w+-][\w.+-]*", self.name):
            raise ValueError(
                f"name is {self.name!r}; expected a file name of letters, digits, +, -, _ and, after the first, dots"
            )
        return self


class Scene(Table):
    """A measurement campaign to be simulated.

    Attributes
    ----------
    name : str
        Shown in messages.
    frame : {"east-north", "east-south"}
        Frame of the positions in the file; :func:`load_scene` converts them to east/north.
    sounder : Sounder
        In the file: the name of a description; default the shipped 132 GHz sounder.
    attenuator : Path, float or None
        Attenuator of the back-to-back recording: touchstone file, loss [dB], or the shipped one.
    snapshots : int
        Captures a direction.
    seed : int
        Of noise and drifts.
    max_order : int
        Largest number of bounces of a path.
    faults : Faults
        Faults of the instrument.
    transmitters : dict of str to (float, float, float)
        Positions by name [m].
    receivers : tuple of Receiver
        Positions to be measured.
    environment : SceneEnvironment
        What reflects.
    """

    name: str
    frame: Literal["east-north", "east-south"] = "east-north"
    sounder: Sounder
    attenuator: Annotated[
        NotNegativeDecibels | RelativePath | None,
        Alternatives("a loss of at least 0 dB, or the name of a touchstone file"),
    ] = None
    snapshots: Annotated[int, Field(ge=1)] = 8
    seed: Annotated[int, Field(ge=0)] = 0
    max_order: Annotated[int, Field(ge=0, le=4)] = 2
    faults: Faults = Faults()
    transmitters: dict[str, Position]
    receivers: Annotated[tuple[Receiver, ...], Field(min_length=1)]
    environment: SceneEnvironment

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        needed = np.dtype(complex).itemsize * self.sounder.waveform.samples * self.snapshots
        if needed > current().max_bytes:
            raise ValueError(f"snapshots: one direction {too_large(needed)}")
        names = [receiver.name for receiver in self.receivers]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"receivers: {twice[0]} appears twice; expected a different name for each position")
        for receiver in self.receivers:
            if receiver.tx not in self.transmitters:
                known = ", ".join(self.transmitters)
                raise ValueError(f"receivers: {receiver.name} names the transmitter {receiver.tx}; known are {known}")
            if receiver.position == self.transmitters[receiver.tx]:
                raise ValueError(f"receivers: {receiver.name} and {receiver.tx} have the same position")
        return self

    def in_east_north(self) -> "Scene":
        """The same scene in the frame east/north."""
        if self.frame == "east-north":
            return self
        drawn = self.environment
        walls = tuple(
            wall.model_copy(update={"points": tuple((x, -y) for x, y in wall.points)}) for wall in drawn.walls
        )
        poles = tuple(
            pole.model_copy(update={"position": (pole.position[0], -pole.position[1])}) for pole in drawn.poles
        )
        receivers = tuple(
            receiver.model_copy(update={"position": _south_to_north(receiver.position)}) for receiver in self.receivers
        )
        converted = {
            "frame": "east-north",
            "transmitters": {name: _south_to_north(position) for name, position in self.transmitters.items()},
            "receivers": receivers,
            "environment": drawn.model_copy(update={"walls": walls, "poles": poles}),
        }
        return self.model_copy(update=converted)


def _south_to_north(position: Position) -> Position:
    return position[0], -position[1], position[2]


def load_scene(path: Path | str) -> Scene:
    """Read a scene; its positions are returned in the frame east/north.

    Parameters
    ----------
    path : path
        TOML file. Files that it names are looked for in its folder.

    Raises
    ------
    DataError
        A file is missing or malformed; the message names the key.

    Examples
    --------
    >>> from sounder import shipped
    >>> scene = load_scene(shipped.scene("uma.toml"))
    >>> len(scene.receivers), scene.receivers[0].name, scene.receivers[0].position
    (35, 'RX1_L', (31.06, -46.6381, 1.4))
    """
    path = Path(path)
    tables = read_toml(path)
    named = tables.get("sounder")
    if named is not None and not isinstance(named, str):
        raise DataError(f"{path}: sounder is {named!r}; expected the name of a description, a TOML file")
    tables["sounder"] = load_sounder(path.parent / named if named else shipped.calibration("sounder-132ghz.toml"))
    return Scene.from_tables(tables, path, file=path).in_east_north()
