"""Assemble the map of the walls and poles that were found, and mark in the table which MPC belongs to which."""

from typing import TYPE_CHECKING, Any

import numpy as np

from erm.maps.environment import Environment, Slab
from erm.maps.materials import Material
from erm.maps.reflectors import make_reflectors
from erm.mpcs.reasons import Reason
from erm.mpcs.standard_errors import SIGMAS
from erm.reconstruction.curved.faces import Curved, arc_azimuths, is_pole
from erm.reconstruction.curved.search import CurvedFace
from erm.reconstruction.decision.decide import Decision
from erm.reconstruction.model.extent import MAX_FRESNEL_MARGIN, piece_ends
from erm.reconstruction.model.loss import refractive_index_squared
from erm.reconstruction.model.paths import IntArray, Paths
from erm.reconstruction.model.relief import relief_and_tilt
from erm.reconstruction.poles.poles import Pole

if TYPE_CHECKING:
    import xarray as xr


def assemble(
    decision: Decision,
    chains: IntArray,
    poles: list[Pole],
    pole_paths: Paths,
    table: "xr.Dataset",
    curved: Curved,
    max_gap: float,
) -> tuple[Environment, "xr.Dataset"]:
    """Make an environment of walls and poles, and mark in the table which MPC belongs to which.

    Parameters
    ----------
    decision : Decision
        Walls, cut into pieces, and rejected candidates.
    chains : array (n,) of int
        Rows of the table that were reflected off several of the walls.
    poles : list of Pole
    pole_paths : Paths
        Paths that the poles' inliers are rows of.
    table : xarray.Dataset
        From `erm.select`.
    curved : Curved
    max_gap : float
        Reflection points on one face further apart than this are on different faces [m].

    Returns
    -------
    environment : Environment
    table : xarray.Dataset
        With ``accepted``, ``reason``, ``wall`` and ``wall_point``, see `erm.reconstruct`.
    """
    ground = float(table.attrs.get("ground_height", 0.0))
    reason = table["reason"].values.astype(object)
    reason[table["accepted"].values] = Reason.NOT_SHARED
    materials: dict[str, Material] = {}
    index = np.full(table.sizes["mpc"], -1)
    wall_point = np.full((table.sizes["mpc"], 3), np.nan)
    for wall, why in decision.rejected:
        reason[wall.paths.row] = why
    reason[chains] = Reason.MULTIPLE_REFLECTION
    names = (
        "end_points",
        "top",
        "normal",
        "offset",
        "covariance",
        "support",
        "residual",
        "relief",
        "tilt",
        "material",
        "unseen",
    )
    columns: dict[str, list] = {name: [] for name in names}
    for wall, pieces in zip(decision.walls, decision.pieces, strict=True):
        line = wall.line.with_pivot(np.zeros(2))
        relief, tilt = relief_and_tilt(wall)
        refractive_index = round(float(np.sqrt(refractive_index_squared(wall))), 1)
        material = Material(f"index {refractive_index}", refractive_index=complex(refractive_index, 0.0))
        materials[material.name] = material
        for piece in pieces:
            rows = wall.paths.row[piece.inliers]
            index[rows] = len(columns["top"])
            reason[rows] = Reason.ACCEPTED
            wall_point[rows] = wall.reflection_points[piece.inliers]
            columns["end_points"].append(piece_ends(wall, piece))
            columns["top"].append(max(wall.reflection_points[piece.inliers, 2].max(), ground) + MAX_FRESNEL_MARGIN)
            columns["normal"].append(line.normal)
            columns["offset"].append(line.offset)
            columns["covariance"].append(line.covariance)
            columns["support"].append(len(piece.inliers))
            columns["residual"].append(wall.reduced_chi_squared)
            columns["relief"].append(relief)
            columns["tilt"].append(tilt)
            columns["material"].append(material.name)
            columns["unseen"].append(piece.unseen)
    reflectors = make_reflectors(
        np.reshape(columns.pop("end_points"), (-1, 2, 2)),
        base=ground,
        **{name: np.asarray(column) for name, column in columns.items()} if columns["top"] else {},
    )
    for number, pole in enumerate(poles, start=reflectors.sizes["reflector"]):
        rows = pole_paths.row[pole.inliers]
        index[rows] = number
        reason[rows] = Reason.ACCEPTED
        wall_point[rows] = table["reflection_point"].values[rows]
        wall_point[rows, :2] = pole.centre
    number = reflectors.sizes["reflector"] + len(poles)
    pillars = [face for face in curved.faces if is_pole(face)]
    bent = [face for face in curved.faces if not is_pole(face)]
    arcs = [(face, *piece) for face in bent for piece in arc_azimuths(face, curved.paths, max_gap)]
    owners = [(face, np.arange(len(face.inliers))) for face in pillars] + [(face, own) for face, _, _, own in arcs]
    for face, inliers in owners:
        rows = curved.paths.row[face.inliers[inliers]]
        index[rows] = number
        reason[rows] = Reason.ACCEPTED
        wall_point[rows] = face.fit.point[inliers]
        number += 1
    slab = Slab(ground) if np.any(table["reason"].values == Reason.GROUND_REFLECTION) else None
    located = table.assign(
        accepted=("mpc", index >= 0),
        reason=("mpc", reason.astype(np.str_)),
        wall=("mpc", index),
        wall_point=(
            ("mpc", "xyz"),
            wall_point,
            {"units": "m", "long_name": "reflection point on the merged wall"},
        ),
    )
    environment = Environment(reflectors, ground=slab, materials=materials)
    if poles:
        environment = environment.with_poles(
            np.array([pole.centre for pole in poles]),
            np.array([pole.radius for pole in poles]),
            base=ground,
            top=np.array([max(pole.top, ground) + MAX_FRESNEL_MARGIN for pole in poles]),
            covariance=np.array(
                [pole.covariance * _covariance_factor(pole.reduced_chi_squared, len(pole.inliers)) for pole in poles]
            ),
            support=np.array([len(pole.inliers) for pole in poles]),
            residual=np.array([pole.reduced_chi_squared for pole in poles]),
        )
    for face in pillars:
        columns = _of_cylinder(face, ground)
        covariance = columns.pop("centre_covariance")
        environment = environment.with_poles([face.fit.centre], face.fit.radius, covariance=covariance, **columns)
    for face, low, high, inliers in arcs:
        columns = _of_cylinder(face, ground) | {"support": len(inliers)}
        environment = environment.with_arcs([face.fit.centre], face.fit.radius, [[low, high]], **columns)
    return environment, located


def _of_cylinder(face: CurvedFace, ground: float) -> dict[str, Any]:
    """Columns of the reflector of a cylinder."""
    support = len(face.inliers)
    residual = float(face.fit.chi_squared.sum()) / max(2 * support - 3, 1)
    covariance = face.fit.covariance * _covariance_factor(residual, support)
    return {
        "base": ground,
        "top": max(float(face.fit.point[:, 2].max()), ground) + MAX_FRESNEL_MARGIN,
        "centre_covariance": covariance[:2, :2],
        "radius_std": float(np.sqrt(covariance[2, 2])),
        "support": support,
        "residual": residual,
    }


def _covariance_factor(reduced_chi_squared: float, support: int) -> float:
    """Factor of a covariance: the reduced chi-squared of a fit of ``support`` paths if it is significantly above 1."""
    threshold = 1 + SIGMAS * np.sqrt(2 / max(2 * support - 2, 1))
    return reduced_chi_squared if reduced_chi_squared > threshold else 1.0
