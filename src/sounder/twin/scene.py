"""A scene to be simulated: what stands where, which links are measured with which sounder; read from TOML."""

import re
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from erm.common.errors import DataError
from sounder import shipped
from sounder.instrument.description import Sounder, load_sounder
from sounder.toml import Alternatives, NotNegative, Positive, RelativePath, Table, read_toml
from sounder.twin.faults import Faults

Place = tuple[float, float, float]
Point = tuple[float, float]
Unbounded = Annotated[float, Field(allow_inf_nan=True)]


class _Upright(Table):
    """What stands from ``base`` to ``top`` [m]."""

    base: Unbounded = 0.0
    top: Unbounded = float("inf")

    @model_validator(mode="after")
    def _rises(self) -> Self:
        if not self.base < self.top:
            raise ValueError(f"top is {self.top:g} m; expected more than base, {self.base:g} m")
        return self


class Wall(_Upright):
    """Vertical walls along a line of points [m], from ``base`` to ``top``; ``closed`` joins the last to the first."""

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
            raise ValueError(f"points name {list(twice[0])} twice in a row; closed joins the last to the first")
        return self


class Pole(_Upright):
    """Vertical cylinder."""

    position: Point
    radius: Positive
    material: str = "metal"


class Slab(Table):
    """Infinite horizontal plane."""

    height: float
    material: str


class Surroundings(Table):
    """What stands around: a file that ``erm.maps.environment`` reads, or walls, poles, ground and ceiling drawn here.

    A file is in the frame east/north whatever the scene's is. ``materials`` holds properties by name, beyond those
    that are known already; see ``erm.maps.materials.Material``.
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
            raise ValueError(f"file and {', '.join(sorted(drawn))} are both given; draw here or name a file")
        if self.ground and self.ceiling and not self.ground.height < self.ceiling.height:
            heights = self.ceiling.height, self.ground.height
            raise ValueError("ceiling.height is {:g} m; expected more than ground.height, {:g} m".format(*heights))
        return self


class Receiver(Table):
    """A position: where the receiver stood, which transmitter it heard, and whether it should see it."""

    name: str
    tx: str
    position: Place
    los: bool | None = None

    @model_validator(mode="after")
    def _names_a_file(self) -> Self:
        if not re.fullmatch(r"[\w+-][\w.+-]*", self.name):
            raise ValueError(
                f"name is {self.name!r}; expected a file's name: letters, digits, +, -, _ and dots after the first"
            )
        return self


class Scene(Table):
    """A measurement campaign to be simulated.

    Attributes
    ----------
    name : str
    frame : {"east-north", "east-south"}
        Of the positions in the file; :func:`load_scene` turns them to east/north/up.
    sounder : Sounder
        In the file: the name of a description; the shipped 132 GHz sounder if absent.
    attenuator : Path, float or None
        Of the back-to-back recording: touchstone file, loss [dB], or the shipped attenuator.
    snapshots : int
        Captures a direction.
    seed : int
        Of noise and drifts.
    max_order : int
        Largest number of bounces traced.
    faults : Faults
        Of the instrument.
    transmitters : dict of str to tuple
        Positions by name [m].
    receivers : tuple of Receiver
    environment : Surroundings
    """

    name: str
    frame: Literal["east-north", "east-south"] = "east-north"
    sounder: Sounder
    attenuator: Annotated[
        NotNegative | RelativePath | None,
        Alternatives("a loss of at least 0 dB, or the name of a touchstone file"),
    ] = None
    snapshots: Annotated[int, Field(ge=1)] = 8
    seed: Annotated[int, Field(ge=0)] = 0
    max_order: Annotated[int, Field(ge=0, le=4)] = 2
    faults: Faults = Faults()
    transmitters: dict[str, Place]
    receivers: Annotated[tuple[Receiver, ...], Field(min_length=1)]
    environment: Surroundings

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        names = [receiver.name for receiver in self.receivers]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"receivers: {twice[0]} is there twice; give every position its own name")
        for receiver in self.receivers:
            if receiver.tx not in self.transmitters:
                known = ", ".join(self.transmitters)
                raise ValueError(f"receivers: {receiver.name} names the transmitter {receiver.tx}; known are {known}")
            if receiver.position == self.transmitters[receiver.tx]:
                raise ValueError(f"receivers: {receiver.name} stands where {receiver.tx} stands")
        return self

    def northward(self) -> "Scene":
        """The same scene in east/north/up: south turned to north where the frame has it the other way."""
        if self.frame == "east-north":
            return self
        east, drawn = {"frame": "east-north"}, self.environment
        walls = tuple(
            wall.model_copy(update={"points": tuple((x, -y) for x, y in wall.points)}) for wall in drawn.walls
        )
        poles = tuple(
            pole.model_copy(update={"position": (pole.position[0], -pole.position[1])}) for pole in drawn.poles
        )
        receivers = tuple(
            receiver.model_copy(update={"position": _turned(receiver.position)}) for receiver in self.receivers
        )
        transmitters = {name: _turned(place) for name, place in self.transmitters.items()}
        surroundings = drawn.model_copy(update={"walls": walls, "poles": poles})
        moved = {"transmitters": transmitters, "receivers": receivers, "environment": surroundings}
        return self.model_copy(update=east | moved)


def _turned(place: Place) -> Place:
    return place[0], -place[1], place[2]


def load_scene(path: Path | str) -> Scene:
    """Read a scene; its positions come back in east/north/up metres.

    Files it names are looked for beside it.

    Raises
    ------
    DataError
        A file is missing or malformed; the message names the key.
    """
    path = Path(path)
    tables = read_toml(path)
    named = tables.get("sounder")
    if named is not None and not isinstance(named, str):
        raise DataError(f"{path}: sounder is {named!r}; expected the name of a description, a TOML file")
    tables["sounder"] = load_sounder(path.parent / named if named else shipped.calibration("sounder-132ghz.toml"))
    return Scene.from_tables(tables, path, file=path).northward()
