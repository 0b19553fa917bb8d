"""A map of the walls and poles that were found, and in the table which component belongs to which."""

from typing import TYPE_CHECKING

import numpy as np

from erm.maps.environment import Environment, Slab
from erm.maps.materials import Material
from erm.maps.reflectors import make_reflectors
from erm.mpcs.reasons import Reason
from erm.reconstruction.decision.decide import Verdict
from erm.reconstruction.model.extent import MOST_MARGIN, ends_of
from erm.reconstruction.model.loss import refractive_index_squared
from erm.reconstruction.model.paths import IntArray, Paths
from erm.reconstruction.poles.poles import Pole

if TYPE_CHECKING:
    import xarray as xr

CLEAR = 3.0  # standard errors by which the strain of a reflector must exceed 1, to say that its errors were too small


def assemble(
    verdict: Verdict, chains: IntArray, poles: list[Pole], of_poles: Paths, table: "xr.Dataset"
) -> tuple[Environment, "xr.Dataset"]:
    """Make an environment of what was found, and say in the table which component belongs to which reflector.

    Parameters
    ----------
    verdict : Verdict
        Walls, cut into pieces, and what was rejected.
    chains : array (n,) of int
        Rows that bounced off several of the walls.
    poles : list of Pole
    of_poles : Paths
        Those that the poles' members are rows of.
    table : xarray.Dataset
        Selected components.

    Returns
    -------
    environment : Environment
    table : xarray.Dataset
        With ``accepted``, ``reason``, ``wall`` and ``wall_point``, see `erm.reconstruction.reconstruct.reconstruct`.
    """
    ground = float(table.attrs.get("ground_height", 0.0))
    reason = table["reason"].values.astype(object)
    reason[table["accepted"].values] = Reason.NOT_SHARED
    materials: dict[str, Material] = {}
    index = np.full(table.sizes["mpc"], -1)
    wall_point = np.full((table.sizes["mpc"], 3), np.nan)
    for wall, why in verdict.rejected:
        reason[wall.paths.row] = why
    reason[chains] = Reason.MULTIPLE_REFLECTION
    names = ("end_points", "top", "normal", "offset", "covariance", "support", "residual", "material")
    columns: dict[str, list] = {name: [] for name in names}
    for wall, pieces in zip(verdict.walls, verdict.pieces, strict=True):
        line = wall.line.about(np.zeros(2))
        wider = _widening(wall.strain, wall.support)
        index_of = round(float(np.sqrt(refractive_index_squared(wall))), 1)
        material = Material(f"index {index_of}", refractive_index=complex(index_of, 0.0))
        materials[material.name] = material
        for piece in pieces:
            members = wall.paths.row[piece.members]
            index[members] = len(columns["top"])
            reason[members] = Reason.ACCEPTED
            wall_point[members] = wall.points[piece.members]
            columns["end_points"].append(ends_of(wall, piece))
            columns["top"].append(max(wall.points[piece.members, 2].max(), ground) + MOST_MARGIN)
            columns["normal"].append(line.normal)
            columns["offset"].append(line.offset)
            columns["covariance"].append(line.covariance * wider)
            columns["support"].append(len(piece.members))
            columns["residual"].append(wall.strain)
            columns["material"].append(material.name)
    reflectors = make_reflectors(
        np.reshape(columns.pop("end_points"), (-1, 2, 2)),
        base=ground,
        **{name: np.asarray(column) for name, column in columns.items()} if columns["top"] else {},
    )
    for number, pole in enumerate(poles, start=reflectors.sizes["reflector"]):
        members = of_poles.row[pole.members]
        index[members] = number
        reason[members] = Reason.ACCEPTED
        wall_point[members] = table["reflection_point"].values[members]
        wall_point[members, :2] = pole.centre
    slab = Slab(ground) if np.any(table["reason"].values == Reason.GROUND_REFLECTION) else None
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
    environment = Environment(reflectors, ground=slab, materials=materials)
    if poles:
        environment = environment.with_poles(
            np.array([pole.centre for pole in poles]),
            np.array([pole.radius for pole in poles]),
            base=ground,
            top=np.array([max(pole.top, ground) + MOST_MARGIN for pole in poles]),
            covariance=np.array([pole.covariance * _widening(pole.strain, len(pole.members)) for pole in poles]),
            support=np.array([len(pole.members) for pole in poles]),
            residual=np.array([pole.strain for pole in poles]),
        )
    return environment, enriched


def _widening(strain: float, support: int) -> float:
    """Factor of a covariance whose paths depart from the fit by clearly more than their errors."""
    return strain if strain > 1 + CLEAR * np.sqrt(2 / max(2 * support - 2, 1)) else 1.0
