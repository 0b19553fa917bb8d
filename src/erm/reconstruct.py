"""From selected components to a map: walls merged, phantoms of double bounces struck out, extents found."""

from collections.abc import Sequence
from itertools import permutations
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from erm.constants import c
from erm.environment import Environment, Slab, make_reflectors
from erm.geometry import unit
from erm.merge import merge
from erm.mpc_table import path_length
from erm.phantom import bounced_twice, obstructs, share_hidden_wall
from erm.select import ACCEPTED
from erm.wall import MARGIN, IntArray, Legs, Paths, Wall

if TYPE_CHECKING:
    import xarray as xr

EXTRA_LOSS = 1.0  # dB; a double bounce loses at least this much more than either of its walls alone

LOSS_OF_ORDER = 3.0  # dB; the two orders of one double bounce meet the same walls at other angles


def reconstruct(
    table: "xr.Dataset", *, min_support: int = 3, max_gap: float = 15.0, face_depth: float = 0.1
) -> tuple[Environment, "xr.Dataset"]:
    """Merge the faces of all positions into walls.

    Parameters
    ----------
    table : xarray.Dataset
        Selected components, from `erm.select.select`.
    min_support : int
        Fewest antenna pairs whose paths must share a wall. Two faces always agree on some wall within their
        errors; the third is the first that can contradict, so 3 is the least that is evidence.
    max_gap : float
        Reflection points on one line further apart than this are ends of different walls [m].
    face_depth : float
        Departure of real faces from a plane, windows and ledges; added to the path lengths' errors [m].

    Returns
    -------
    environment : Environment
        Best supported wall first. Walls reach ``MARGIN`` beyond their outermost and highest reflection point
        and down to the ground; there is a ground if a bounce off it was seen.
    table : xarray.Dataset
        The table with ``wall`` (index of the reflector, -1 none) and ``wall_point`` (mpc, xyz) [m], where the
        merged wall reflects this path. Components without a wall are no longer accepted and say why.
    """
    rows = np.flatnonzero(table["accepted"].values)
    paths = _paths(table, rows, face_depth)
    ground = float(table.attrs.get("ground_height", 0.0))
    candidates = [Wall(paths, found.line, found.members) for found in merge(paths, min_support)]
    reason = table["reason"].values.astype(object)
    reason[rows] = "no wall shared with other positions"

    walls: list[Wall] = []
    for wall in sorted(candidates, key=lambda wall: round(wall.loss, 6)):
        lines = [other.line for other in walls if other.loss < wall.loss - EXTRA_LOSS]
        if np.mean(bounced_twice(wall.paths, lines, ground)) > 0.5:
            reason[rows[wall.members]] = "bounced twice, off other walls or the ground"
        else:
            walls.append(wall)
    phantoms = _of_hidden_walls(walls)
    for wall in phantoms:
        reason[rows[wall.members]] = "bounced twice, off another wall and one nobody saw alone"
    kept: list[Wall] = []
    sight = _lines_of_sight(table)
    for wall in sorted((wall for wall in walls if wall not in phantoms), key=lambda wall: -wall.support):
        twin = next((i for i, other in enumerate(kept) if other.is_twin(wall, max_gap)), None)
        if twin is not None:
            reason[rows[wall.members]] = "second image of a wall"
            kept[twin] = kept[twin].joined(wall)
        elif obstructs(wall, kept, sight):
            reason[rows[wall.members]] = "wall would stand in the way of other paths"
        else:
            kept.append(wall)
    return _map(kept, table, rows, reason, max_gap, sight)


def _of_hidden_walls(walls: Sequence[Wall]) -> list[Wall]:
    """Pairs of walls that are one double bounce in its two orders, off a better supported wall and a hidden one.

    Both orders lose about the same, and more than the known wall alone.
    """
    phantoms: list[Wall] = []
    for known, wall, other in permutations(walls, 3):
        weaker = known.support > max(wall.support, other.support)
        lossier = known.loss + EXTRA_LOSS < min(wall.loss, other.loss)
        alike = abs(wall.loss - other.loss) < LOSS_OF_ORDER
        if weaker and lossier and alike and share_hidden_wall(wall, other, known):
            phantoms += [found for found in (wall, other) if found not in phantoms]
    return phantoms


def _lines_of_sight(table: "xr.Dataset") -> Legs:
    """Direct paths known to be clear."""
    clear = (table["los"].values == 1) | ((table["reason"].values == "direct path") & (table["los"].values != 0))
    _, first = np.unique(table["link"].values[clear], return_index=True)
    return Legs(table["tx_position"].values[clear][first], table["rx_position"].values[clear][first])


def _paths(table: "xr.Dataset", rows: IntArray, face_depth: float) -> Paths:
    """Return the accepted rows as arrays."""
    chosen = table.isel(mpc=rows)
    return Paths(
        tx=chosen["tx_position"].values,
        rx=chosen["rx_position"].values,
        length=path_length(chosen),
        azimuth=chosen["azimuth"].values,
        length_std=np.hypot(chosen["delay_std"].values * c, face_depth),
        azimuth_std=chosen["azimuth_std"].values,
        link=chosen["link"].values,
        loss=chosen["reflection_loss"].values,
    )


def _map(
    walls: Sequence[Wall],
    table: "xr.Dataset",
    rows: IntArray,
    reason: npt.NDArray[np.object_],
    max_gap: float,
    sight: Legs,
) -> tuple[Environment, "xr.Dataset"]:
    """Cut walls into stretches, and say in the table which component belongs to which."""
    ground = float(table.attrs.get("ground_height", 0.0))
    free = sight
    index = np.full(table.sizes["mpc"], -1)
    wall_point = np.full((table.sizes["mpc"], 3), np.nan)
    columns: dict[str, list] = {name: [] for name in ("end_points", "top", "normal", "offset", "covariance", "support")}
    for wall in walls:
        line = wall.line.about(np.zeros(2))
        points = wall.points
        along = wall.along(points)
        foot = wall.line.pivot + wall.line.offset * unit(wall.line.normal)
        for run in wall.stretches(max_gap, free):
            members = rows[wall.members[run]]
            reach = np.array([along[run].min() - MARGIN, along[run].max() + MARGIN])
            index[members] = len(columns["top"])
            reason[members] = ACCEPTED
            wall_point[members] = points[run]
            columns["end_points"].append(foot + reach[:, None] * unit(wall.line.normal + 90))
            columns["top"].append(max(points[run, 2].max(), ground) + MARGIN)
            columns["normal"].append(line.normal)
            columns["offset"].append(line.offset)
            columns["covariance"].append(line.covariance * max(wall.strain, 1.0))
            columns["support"].append(len(run))
        free = Legs(*(np.vstack(pair) for pair in zip(free, wall.legs(), strict=True)))
    reflectors = make_reflectors(
        np.reshape(columns.pop("end_points"), (-1, 2, 2)),
        base=ground,
        **{name: np.asarray(column) for name, column in columns.items()} if columns["top"] else {},
    )
    slab = Slab(ground) if np.any(table["reason"].values == "ground bounce") else None
    enriched = table.assign(
        accepted=("mpc", index >= 0),
        reason=("mpc", reason.astype(np.str_)),
        wall=("mpc", index),
        wall_point=(
            ("mpc", "xyz"),
            wall_point,
            {"units": "m", "long_name": "where the merged wall reflects"},
        ),
    )
    return Environment(reflectors, ground=slab), enriched
