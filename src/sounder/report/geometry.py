"""Walls, poles, arcs and reflection points for the map of the page."""

from typing import Any

import numpy as np
import xarray as xr

from erm.maps.arcs import arc_points
from erm.mpcs.reasons import Reason
from sounder.report.contents import Contents
from sounder.report.numbers import ellipse, rounded

COLUMNS = {"delay": 1e9, "azimuth": 1.0, "elevation": 1.0, "path_gain": 1.0}
"""Columns of MPCs with the factors to the units of the page: ns, degree, dB."""


def mpc_columns(contents: Contents) -> dict[str, Any]:
    """Columns of all MPCs, as measured, and their use.

    Returns
    -------
    dict
        ``position``, an index; :data:`COLUMNS` and their standard deviations; ``use``, an index of ``uses``, texts;
        ``reflector``, an index or -1; ``point``, east and north of the reflection point of an accepted MPC [m];
        ``ellipse``, its error; ``loss``, of the reflection [dB].
    """
    located = contents.located
    index = {name: number for number, name in enumerate(contents.names)}
    uses, use = np.unique(located["reason"].values.astype(str), return_inverse=True)
    accepted = located["accepted"].values
    points = np.where(accepted[:, None], located["reflection_point"].values[:, :2], np.nan)
    columns: dict[str, Any] = {
        "position": [index.get(str(name), -1) for name in located["position"].values],
        "uses": [Reason(value).text for value in uses.tolist()],
        "use": use.tolist(),
        "reflector": located["wall"].values.tolist(),
        "point": [None if None in point else point for point in rounded(points, 2)],
        "ellipse": [
            ellipse(covariance) if used else None
            for used, covariance in zip(accepted, located["point_covariance"].values[:, :2, :2], strict=True)
        ],
        "loss": rounded(located["reflection_loss"].values, 1),
    }
    for name, scale in COLUMNS.items():
        columns[name] = rounded(contents.table[name].values * scale, 3)
        columns[f"{name}_std"] = rounded(contents.table[f"{name}_std"].values * scale, 4)
    return columns


def reflectors(table: xr.Dataset) -> list[dict[str, Any]]:
    """Walls, poles and arcs with what is known of each.

    Returns
    -------
    list of dict
        ``kind``; ``line``, its points [m], one for a pole; ``ellipse`` of a pole's centre; and for the tables
        ``centre``, ``radius``, ``normal`` and ``offset`` with standard deviations, ``length``, ``base``, ``top``,
        ``support``, ``material``.
    """
    found = []
    for number in range(table.sizes["reflector"]):
        one = table.isel(reflector=number)
        kind, ends, radius = str(one["kind"].item()), one["end_points"].values, float(one["radius"].item())
        line = ends[:1] if kind == "pole" else ends
        if kind == "arc":
            line = arc_points(ends, one["centre"].values, radius)
        std = np.sqrt(np.diag(one["covariance"].values))
        numbers = {name: rounded(one[name].item(), 4) for name in ("normal", "offset", "radius_std", "base", "top")}
        found.append(
            {
                "kind": kind,
                "line": rounded(line, 3),
                "centre": rounded(ends[0] if kind == "pole" else one["centre"].values, 3),
                "radius": rounded(radius, 4),
                "ellipse": ellipse(one["centre_covariance"].values) if kind == "pole" else None,
                **numbers,
                "normal_std": rounded(std[0], 4),
                "offset_std": rounded(std[1], 4),
                "length": rounded(np.sum(np.linalg.norm(np.diff(line, axis=0), axis=1)), 2),
                "support": int(one["support"].item()),
                "material": str(one["material"].item()),
            }
        )
    return found
