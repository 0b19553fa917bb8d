"""The map: walls and poles with their uncertainty, ground and ceiling, and what they are made of."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from erm.common.errors import DataError
from erm.geometry.vertical import unit
from erm.maps.georeference import Georeference
from erm.maps.materials import LIBRARY, Material

if TYPE_CHECKING:
    import xarray as xr

DEFAULT_MATERIAL = "concrete"
GROUND, CEILING, NO_BOUNCE = -1, -2, -3
"""What a path bounced off that is no reflector of the map: the ground, the ceiling, nothing."""
VARIABLES: Mapping[str, tuple[tuple[str, ...], str, str]] = {
    "kind": ((), "", "wall or pole"),
    "end_points": (("end", "xy"), "m", "ends of the reflector, east and north"),
    "radius": ((), "m", "radius of a pole"),
    "base": ((), "m", "height of the lower edge"),
    "top": ((), "m", "height of the upper edge"),
    "normal": ((), "degree", "azimuth of the face normal"),
    "offset": ((), "m", "distance of the wall from the origin along its normal"),
    "covariance": (("parameter", "parameter_2"), "", "covariance of normal [degree] and offset [m]"),
    "centre_covariance": (("xy", "xy_2"), "m2", "covariance of the centre of a pole, east and north"),
    "support": ((), "1", "number of multipath components behind the reflector"),
    "residual": ((), "1", "chi-squared of these components a degree of freedom"),
    "material": ((), "", "name of the material"),
}


def make_reflectors(
    end_points: ArrayLike,
    *,
    kind: ArrayLike = "wall",
    radius: ArrayLike = 0.0,
    base: ArrayLike = 0.0,
    top: ArrayLike = np.inf,
    normal: ArrayLike = np.nan,
    offset: ArrayLike = np.nan,
    covariance: ArrayLike = np.nan,
    centre_covariance: ArrayLike = np.nan,
    support: ArrayLike = 0,
    residual: ArrayLike = np.nan,
    material: ArrayLike = DEFAULT_MATERIAL,
) -> "xr.Dataset":
    """Table of reflectors; every column but the end points broadcasts from one value.

    A wall through ``p`` with normal azimuth ``phi`` is the line ``n.p = offset``, ``n = (cos phi, sin phi)``.
    Where ``normal`` or ``offset`` of a wall is NaN both come from its end points, with the normal to the left
    of first -> second end, so that it points into a polygon drawn counter-clockwise.

    Parameters
    ----------
    end_points : array (reflector, 2, 2)
        End points, east/north [m]; both are the centre for a pole.
    kind : array (reflector,) of {"wall", "pole"}
    radius : array (reflector,)
        Radius of a pole [m]; 0 for a wall.
    base, top : array (reflector,)
        Heights of the lower and upper edge [m]; may be infinite.
    normal, offset : array (reflector,)
        Azimuth of the normal [degree] and ``n.p`` [m]; NaN for poles.
    covariance : array (reflector, 2, 2)
        Of (normal [degree], offset [m]); NaN if unknown, and for poles.
    centre_covariance : array (reflector, 2, 2)
        Of the centre of a pole, (east, north) [m2]; NaN if unknown, and for walls.
    support : array (reflector,) of int
        Number of multipath components that built it; 0 for drawn ones.
    residual : array (reflector,)
        Chi-squared of these components a degree of freedom; NaN if unknown.
    material : array (reflector,) of str

    Returns
    -------
    xarray.Dataset
        Dimension ``reflector``, possibly of length 0.
    """
    import xarray as xr

    ends = np.asarray(end_points, dtype=float)
    ends = ends.reshape(-1, 2, 2) if ends.size == 0 else ends
    if ends.ndim != 3 or ends.shape[1:] != (2, 2):
        raise DataError(f"end points of shape {ends.shape}; expected (reflector, 2 ends, 2 coordinates)")
    count = len(ends)
    columns: dict[str, np.ndarray] = {"end_points": ends}
    given: tuple[tuple[str, ArrayLike, type, tuple[int, ...]], ...] = (
        ("kind", kind, str, ()),
        ("radius", radius, float, ()),
        ("base", base, float, ()),
        ("top", top, float, ()),
        ("normal", normal, float, ()),
        ("offset", offset, float, ()),
        ("covariance", covariance, float, (2, 2)),
        ("centre_covariance", centre_covariance, float, (2, 2)),
        ("support", support, np.int64, ()),
        ("residual", residual, float, ()),
        ("material", material, str, ()),
    )
    for name, value, dtype, shape in given:
        columns[name] = np.array(np.broadcast_to(np.asarray(value, dtype=dtype), (count, *shape)))

    along = ends[:, 1] - ends[:, 0]
    azimuth = np.degrees(np.arctan2(along[:, 0], -along[:, 1])) % 360  # the left of `along`
    derived = (columns["kind"] == "wall") & (np.isnan(columns["normal"]) | np.isnan(columns["offset"]))
    columns["normal"] = np.where(derived, azimuth, columns["normal"] % 360)
    left = unit(columns["normal"])
    columns["offset"] = np.where(derived, (left * ends[:, 0]).sum(-1), columns["offset"])
    return xr.Dataset(
        {
            name: (
                ("reflector", *dims),
                columns[name],
                {"long_name": text} | ({"units": units} if units else {}),
            )
            for name, (dims, units, text) in VARIABLES.items()
        }
    )


@dataclass(frozen=True)
class Slab:
    """An infinite horizontal plane: the ground or a ceiling.

    Parameters
    ----------
    height : float
        Height [m].
    material : str
        Name of the material.
    """

    height: float
    material: str = DEFAULT_MATERIAL


@dataclass(frozen=True)
class Environment:
    """Reflectors of a place, in local east/north/up metres.

    Parameters
    ----------
    reflectors : xarray.Dataset
        Table of `make_reflectors`.
    ground, ceiling : Slab, optional
        Infinite planes below and above; absent if None.
    materials : mapping of str to Material
        Those of the reflectors; names that are missing here are taken from `erm.maps.materials.LIBRARY`.
    georeference : Georeference, optional
        Where on earth the local frame lies. What is moved or turned in the frame leaves it alone.

    Raises
    ------
    DataError
        The table breaks a rule: the message says which reflector and why.
    """

    reflectors: "xr.Dataset"
    ground: Slab | None = None
    ceiling: Slab | None = None
    materials: Mapping[str, Material] = field(default_factory=dict)
    georeference: Georeference | None = None

    def __post_init__(self) -> None:
        _check(self.reflectors)
        if self.ground and self.ceiling and not self.ground.height < self.ceiling.height:
            raise DataError(f"ceiling at {self.ceiling.height} m is not above the ground at {self.ground.height} m")
        used = set(self.reflectors.material.values.tolist())
        used |= {slab.material for slab in (self.ground, self.ceiling) if slab}
        if unknown := sorted(used - set(self.materials) - set(LIBRARY)):
            raise DataError(f"unknown material {unknown[0]!r}; define it, or use one of {', '.join(LIBRARY)}")
        complete = {name: LIBRARY[name] for name in sorted(used - set(self.materials))} | dict(self.materials)
        object.__setattr__(self, "materials", complete)

    @classmethod
    def empty(cls, **others: Any) -> "Environment":
        """Nothing stands there; ``ground``, ``ceiling`` and ``materials`` may be given."""
        return cls(make_reflectors(np.empty((0, 2, 2))), **others)

    @classmethod
    def walls(
        cls,
        end_points: ArrayLike,
        *,
        base: ArrayLike = 0.0,
        top: ArrayLike = np.inf,
        material: ArrayLike = DEFAULT_MATERIAL,
        **others: Any,
    ) -> "Environment":
        """Vertical walls between end points (wall, 2, 2) [m]; ``others`` are the fields of the class."""
        return cls(make_reflectors(end_points, base=base, top=top, material=material), **others)

    def with_poles(
        self,
        centres: ArrayLike,
        radius: ArrayLike,
        *,
        base: ArrayLike = 0.0,
        top: ArrayLike = np.inf,
        covariance: ArrayLike = np.nan,
        support: ArrayLike = 0,
        residual: ArrayLike = np.nan,
        material: ArrayLike = "metal",
    ) -> "Environment":
        """The same place with vertical poles after its reflectors, at centres (pole, 2) [m] of some covariance [m2]."""
        import xarray as xr

        centre = np.asarray(centres, dtype=float).reshape(-1, 1, 2)
        poles = make_reflectors(
            np.repeat(centre, 2, axis=1),
            kind="pole",
            radius=radius,
            base=base,
            top=top,
            centre_covariance=covariance,
            support=support,
            residual=residual,
            material=material,
        )
        joined = xr.concat([self.reflectors, poles], dim="reflector")
        return replace(self, reflectors=joined)

    def moved(self, rotation_deg: float, translation: Sequence[float] | np.ndarray) -> "Environment":
        """Rotate about the origin counter-clockwise, then translate.

        With ``n'`` the turned normal and ``t`` the translation, ``offset' = offset + n'.t``, so the
        covariance follows ``J C J^T`` with ``J = [[1, 0], [pi/180 n'_perp.t, 1]]``: a wall whose direction is
        uncertain is uncertain in its offset from a far origin.

        Parameters
        ----------
        rotation_deg : float
            Angle [degree].
        translation : array (2,) or (3,)
            East, north and possibly up [m].
        """
        shift = np.zeros(3)
        shift[: len(translation)] = translation
        table = self.reflectors.copy()
        turn = np.stack([unit(rotation_deg), unit(rotation_deg + 90)])  # rows: images of east and north
        normal = (table.normal.values + rotation_deg) % 360
        jacobian = np.tile(np.eye(2), (len(normal), 1, 1))
        jacobian[:, 1, 0] = np.radians(unit(normal + 90) @ shift[:2])
        moved = {
            "end_points": table.end_points.values @ turn + shift[:2],
            "normal": normal,
            "offset": table.offset.values + unit(normal) @ shift[:2],
            "covariance": jacobian @ table.covariance.values @ jacobian.swapaxes(1, 2),
            "centre_covariance": turn.T @ table.centre_covariance.values @ turn,
            "base": table.base.values + shift[2],
            "top": table.top.values + shift[2],
        }
        for name, values in moved.items():
            table[name] = table[name].copy(data=values)
        ground = self.ground and replace(self.ground, height=self.ground.height + float(shift[2]))
        ceiling = self.ceiling and replace(self.ceiling, height=self.ceiling.height + float(shift[2]))
        return replace(self, reflectors=table, ground=ground, ceiling=ceiling)


def _check(table: "xr.Dataset") -> None:
    """Hold the table to its rules; the message names the first reflector that breaks one."""
    if missing := [name for name in VARIABLES if name not in table]:
        raise DataError(f"reflectors lack {', '.join(missing)}; build them with make_reflectors")
    kind = table.kind.values
    ends = table.end_points.values
    is_wall = kind == "wall"
    length = np.hypot(*np.moveaxis(ends[:, 1] - ends[:, 0], -1, 0))
    base, top = table.base.values, table.top.values
    rules = (
        (is_wall | (kind == "pole"), "is neither a wall nor a pole"),
        (np.isfinite(ends).all(axis=(1, 2)), "has end points that are not numbers"),
        (~is_wall | (length > 0), "is a wall of no length"),
        (is_wall | (table.radius.values > 0), "is a pole without a positive radius"),
        (base < top, "has its top not above its base"),
    )
    for holds, complaint in rules:
        if not holds.all():
            raise DataError(f"reflector {int(np.argmin(holds))} {complaint}")
