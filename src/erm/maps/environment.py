"""The environment: reflectors, ground and ceiling, their materials, and their place on earth."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from erm.common.constants import FARTHEST
from erm.common.errors import DataError
from erm.geometry.vertical import unit
from erm.maps.georeference import Georeference
from erm.maps.materials import LIBRARY, Material
from erm.maps.reflectors import DEFAULT_MATERIAL, check_reflectors, make_reflectors

if TYPE_CHECKING:
    import xarray as xr

GROUND, CEILING, NO_BOUNCE = -1, -2, -3
"""Indices in place of a reflector: reflection by the ground, by the ceiling, no reflection."""


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
        Walls, poles and arcs; a table of `erm.maps.reflectors.make_reflectors`.
    ground, ceiling : Slab, optional
        Infinite planes below and above; absent if None.
    materials : mapping of str to Material
        Materials of the reflectors by name. Missing ones are taken from `erm.maps.materials.LIBRARY`.
    georeference : Georeference, optional
        Place of the local frame on earth. `moved` does not change it.

    Raises
    ------
    DataError
        The table breaks a rule. The message names the reflector and the rule.

    Examples
    --------
    >>> import erm
    >>> street = erm.Environment.walls([[[-60, 10], [60, 10]]], top=20.0, material="glass")
    >>> street = street.with_poles([[5, 4]], radius=0.1, top=6.0)
    >>> street.reflectors["kind"].values.tolist(), street.reflectors["offset"].values.round(2).tolist()
    (['wall', 'pole'], [10.0, nan])
    >>> sorted(street.materials)
    ['glass', 'metal']
    """

    reflectors: "xr.Dataset"
    ground: Slab | None = None
    ceiling: Slab | None = None
    materials: Mapping[str, Material] = field(default_factory=dict)
    georeference: Georeference | None = None

    def __post_init__(self) -> None:
        check_reflectors(self.reflectors)
        for slab in (self.ground, self.ceiling):
            if slab and not abs(slab.height) < FARTHEST:
                raise DataError(f"ground or ceiling at {slab.height} m; expected a height on earth")
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
        """An environment without reflectors; ``others`` are the other fields of the class."""
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
        """Vertical walls between end points (wall, 2, 2) [m]; ``others`` are the other fields of the class."""
        return cls(make_reflectors(end_points, base=base, top=top, material=material), **others)

    def with_poles(
        self,
        centres: ArrayLike,
        radius: ArrayLike,
        *,
        base: ArrayLike = 0.0,
        top: ArrayLike = np.inf,
        covariance: ArrayLike = np.nan,
        material: ArrayLike = "metal",
        **others: Any,
    ) -> "Environment":
        """Add vertical poles with centres (pole, 2) [m] and their covariance (pole, 2, 2) [m2] after the reflectors.

        ``others`` are arguments of `erm.maps.reflectors.make_reflectors`.
        """
        import xarray as xr

        centre = np.asarray(centres, dtype=float).reshape(-1, 1, 2)
        poles = make_reflectors(
            np.repeat(centre, 2, axis=1),
            kind="pole",
            radius=radius,
            base=base,
            top=top,
            centre_covariance=covariance,
            material=material,
            **others,
        )
        joined = xr.concat([self.reflectors, poles], dim="reflector")
        return replace(self, reflectors=joined)

    def with_arcs(
        self,
        centres: ArrayLike,
        radius: ArrayLike,
        azimuths: ArrayLike,
        *,
        material: ArrayLike = DEFAULT_MATERIAL,
        **others: Any,
    ) -> "Environment":
        """Add vertical curved faces after the reflectors.

        Parameters
        ----------
        centres : array (arc, 2)
            [m].
        radius : array (arc,)
            Negative where the face is concave toward the antennas [m].
        azimuths : array (arc, 2)
            Of both ends, seen from the centre, counter-clockwise from the first to the second [degree].
        material : str or array (arc,) of str
        **others
            Other arguments of `erm.maps.reflectors.make_reflectors`.

        Examples
        --------
        >>> import erm
        >>> corner = erm.Environment.empty().with_arcs([[0, 0]], 2.0, [[0, 90]])
        >>> corner.reflectors["end_points"].values.round(2).tolist()
        [[[2.0, 0.0], [0.0, 2.0]]]
        """
        import xarray as xr

        centre = np.asarray(centres, dtype=float).reshape(-1, 2)
        size = np.broadcast_to(np.abs(np.asarray(radius, dtype=float)), len(centre))
        ends = centre[:, None] + size[:, None, None] * unit(np.reshape(azimuths, (-1, 2)))
        arcs = make_reflectors(ends, kind="arc", radius=radius, centre=centre, material=material, **others)
        return replace(self, reflectors=xr.concat([self.reflectors, arcs], dim="reflector"))

    def moved(self, rotation_deg: float, translation: Sequence[float] | np.ndarray) -> "Environment":
        """Rotate counter-clockwise about the origin, then translate.

        With ``n'`` the rotated normal and ``t`` the translation, ``offset' = offset + n'.t``. The covariance becomes
        ``J C J^T`` with ``J = [[1, 0], [pi/180 n'_perp.t, 1]]``: an uncertain direction makes the offset from a far
        origin uncertain.

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
        rotation = np.stack([unit(rotation_deg), unit(rotation_deg + 90)])  # rows: images of east and north
        normal = (table.normal.values + rotation_deg) % 360
        jacobian = np.tile(np.eye(2), (len(normal), 1, 1))
        jacobian[:, 1, 0] = np.radians(unit(normal + 90) @ shift[:2])
        moved = {
            "end_points": table.end_points.values @ rotation + shift[:2],
            "centre": table.centre.values @ rotation + shift[:2],
            "normal": normal,
            "offset": table.offset.values + unit(normal) @ shift[:2],
            "covariance": jacobian @ table.covariance.values @ jacobian.swapaxes(1, 2),
            "centre_covariance": rotation.T @ table.centre_covariance.values @ rotation,
            "base": table.base.values + shift[2],
            "top": table.top.values + shift[2],
        }
        for name, values in moved.items():
            table[name] = table[name].copy(data=values)
        ground = self.ground and replace(self.ground, height=self.ground.height + float(shift[2]))
        ceiling = self.ceiling and replace(self.ceiling, height=self.ceiling.height + float(shift[2]))
        return replace(self, reflectors=table, ground=ground, ceiling=ceiling)
