"""The table of reflectors: walls, poles and arcs with their uncertainty, one `xarray.Dataset` along ``reflector``."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from erm.common.console import counted
from erm.common.constants import FARTHEST
from erm.common.errors import DataError
from erm.geometry.vertical import unit

if TYPE_CHECKING:
    import xarray as xr

DEFAULT_MATERIAL = "concrete"
MAX_OFF_CIRCLE = 0.01
"""Distance of the ends of an arc from its circle that files round to [m], and as a share of the radius."""
OFF_CIRCLE = "is an arc whose ends are not on the circle of its centre and radius"
VARIABLES: Mapping[str, tuple[tuple[str, ...], str, str]] = {
    "kind": ((), "", "wall, pole or arc"),
    "end_points": (("end", "xy"), "m", "end points, east and north"),
    "radius": ((), "m", "radius of a pole or arc, negative where concave toward the antennas"),
    "radius_std": ((), "m", "standard deviation of the radius"),
    "centre": (("xy",), "m", "centre of a pole or arc, east and north"),
    "base": ((), "m", "height of the lower edge"),
    "top": ((), "m", "height of the upper edge"),
    "normal": ((), "degree", "azimuth of the face normal"),
    "offset": ((), "m", "distance of the wall from the origin along its normal"),
    "covariance": (("parameter", "parameter_2"), "", "covariance of normal [degree] and offset [m]"),
    "centre_covariance": (("xy", "xy_2"), "m2", "covariance of the centre of a pole or arc, east and north"),
    "support": ((), "1", "number of MPCs of the reflector"),
    "residual": ((), "1", "chi-squared of these MPCs per degree of freedom"),
    "relief": ((), "m", "standard deviation of the offsets of the parts of a facade"),
    "tilt": ((), "degree", "standard deviation of the directions of the parts of a facade"),
    "unseen": (("end",), "m", "length beyond each end of a wall up to which it may go on unseen"),
    "material": ((), "", "name of the material"),
}
"""Further dimensions, unit and description of each variable."""


def make_reflectors(
    end_points: ArrayLike,
    *,
    kind: ArrayLike = "wall",
    radius: ArrayLike = 0.0,
    radius_std: ArrayLike = np.nan,
    centre: ArrayLike = np.nan,
    base: ArrayLike = 0.0,
    top: ArrayLike = np.inf,
    normal: ArrayLike = np.nan,
    offset: ArrayLike = np.nan,
    covariance: ArrayLike = np.nan,
    centre_covariance: ArrayLike = np.nan,
    support: ArrayLike = 0,
    residual: ArrayLike = np.nan,
    relief: ArrayLike = np.nan,
    tilt: ArrayLike = np.nan,
    unseen: ArrayLike = np.nan,
    material: ArrayLike = DEFAULT_MATERIAL,
) -> "xr.Dataset":
    """Make a table of reflectors. Single values apply to all reflectors.

    A wall through ``p`` with normal azimuth ``phi`` is the line ``n.p = offset``, ``n = (cos phi, sin phi)``.
    Where ``normal`` or ``offset`` of a wall is NaN, both follow from the end points. The normal then points to the
    left of first -> second end, so into a polygon that is drawn counter-clockwise.

    Parameters
    ----------
    end_points : array (reflector, 2, 2)
        End points, east/north [m]; both are the centre for a pole. An arc goes counter-clockwise about its centre.
    kind : array (reflector,) of {"wall", "pole", "arc"}
    radius : array (reflector,)
        Radius of a pole or arc [m], negative where the face is concave toward the antennas; 0 for a wall.
    radius_std : array (reflector,)
        Its standard deviation [m]; NaN if unknown.
    centre : array (reflector, 2)
        Centre of an arc, east/north [m]; NaN for a wall. That of a pole is its end point.
    base, top : array (reflector,)
        Heights of the lower and upper edge [m]; may be infinite.
    normal, offset : array (reflector,)
        Azimuth of the normal [degree] and ``n.p`` [m]; NaN for poles and arcs.
    covariance : array (reflector, 2, 2)
        Covariance of (normal [degree], offset [m]); NaN if unknown, and for poles and arcs.
    centre_covariance : array (reflector, 2, 2)
        Covariance of the centre of a pole or arc, (east, north) [m2]; NaN if unknown, and for walls.
    support : array (reflector,) of int
        Number of MPCs that the reflector was made from; 0 for a drawn one.
    residual : array (reflector,)
        Chi-squared of these MPCs per degree of freedom; NaN if unknown.
    relief, tilt : array (reflector,)
        Standard deviations of the offsets [m] and directions [degree] of the parts of a facade; NaN if unknown.
    unseen : array (reflector, 2)
        Length beyond each end of a wall up to which it may go on [m]: no link would have shown it. From there on links
        that should have seen it did not. NaN where nothing shows its end.
    material : array (reflector,) of str

    Returns
    -------
    xarray.Dataset
        Dimension ``reflector``, possibly of length 0.

    Raises
    ------
    DataError
        The end points have another shape.
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
        ("radius_std", radius_std, float, ()),
        ("centre", centre, float, (2,)),
        ("base", base, float, ()),
        ("top", top, float, ()),
        ("normal", normal, float, ()),
        ("offset", offset, float, ()),
        ("covariance", covariance, float, (2, 2)),
        ("centre_covariance", centre_covariance, float, (2, 2)),
        ("support", support, np.int64, ()),
        ("residual", residual, float, ()),
        ("relief", relief, float, ()),
        ("tilt", tilt, float, ()),
        ("unseen", unseen, float, (2,)),
        ("material", material, str, ()),
    )
    for name, value, dtype, shape in given:
        columns[name] = np.array(np.broadcast_to(np.asarray(value, dtype=dtype), (count, *shape)))

    derived = (columns["kind"] == "wall") & (np.isnan(columns["normal"]) | np.isnan(columns["offset"]))
    with np.errstate(over="ignore", invalid="ignore"):  # `check_reflectors` refuses what is no place
        along = ends[:, 1] - ends[:, 0]
        azimuth = np.degrees(np.arctan2(along[:, 0], -along[:, 1])) % 360  # the left of `along`
        columns["normal"] = np.where(derived, azimuth, columns["normal"] % 360)
        columns["offset"] = np.where(derived, (unit(columns["normal"]) * ends[:, 0]).sum(-1), columns["offset"])
    columns["centre"] = np.where((columns["kind"] == "pole")[:, None], ends[:, 0], columns["centre"])
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


def check_reflectors(table: "xr.Dataset") -> None:
    """Refuse a table that breaks a rule.

    Raises
    ------
    DataError
        The message names the first reflector that breaks a rule, and the rule.
    """
    if missing := [name for name in VARIABLES if name not in table]:
        raise DataError(f"reflectors lack {', '.join(missing)}; make them with make_reflectors")
    kind = table.kind.values
    ends = table.end_points.values
    is_wall, is_arc = kind == "wall", kind == "arc"
    size = np.abs(table.radius.values)
    with np.errstate(over="ignore", invalid="ignore"):  # the first rule refuses what is no place
        off = np.linalg.norm(ends - table.centre.values[:, None], axis=-1) - size[:, None]
        length = np.hypot(*np.moveaxis(ends[:, 1] - ends[:, 0], -1, 0))
    base, top = table.base.values, table.top.values
    beyond = [(np.abs(height) >= FARTHEST) & np.isfinite(height) for height in (base, top)]
    rules = (
        (is_wall | is_arc | (kind == "pole"), "is no wall, pole or arc"),
        ((np.abs(ends) < FARTHEST).all(axis=(1, 2)), "has end points that are not finite numbers of places on earth"),
        (~is_wall | (length > 0), "is a wall of length 0"),
        (is_wall | is_arc | (table.radius.values > 0), "is a pole without a positive radius"),
        (~is_arc | (size > 0), "is an arc without a radius"),
        (~is_arc | (np.abs(off) <= MAX_OFF_CIRCLE + MAX_OFF_CIRCLE * size[:, None]).all(axis=1), OFF_CIRCLE),
        (~(size >= FARTHEST), "has a radius beyond all places on earth"),
        (base < top, "has a top that is not above its base"),
        (~np.any(beyond, axis=0), "has a base or top that is neither infinite nor a place on earth"),
    )
    for holds, problem in rules:
        if not holds.all():
            raise DataError(f"reflector {int(np.argmin(holds))} {problem}")


def counted_reflectors(kinds: Sequence[str]) -> str:
    """Number of reflectors of each kind in words.

    Examples
    --------
    >>> counted_reflectors(["wall", "wall", "arc"])
    '2 walls, 1 arc and 0 poles'
    """
    wall, arc, pole = (counted(kinds.count(kind), kind) for kind in ("wall", "arc", "pole"))
    return f"{wall}, {arc} and {pole}" if "arc" in kinds else f"{wall} and {pole}"
