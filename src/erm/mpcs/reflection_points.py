"""Reflection points on disk."""

import csv
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from erm.common.storage import atomic_path

if TYPE_CHECKING:
    import xarray as xr


def write_reflection_points(table: "xr.Dataset", path: Path | str) -> None:
    """Write accepted components as CSV: reflection points, their errors, their walls.

    ``std_along``, ``std_across`` and ``std_up`` are the standard errors of the point along and across its face and of
    its height; ``wall_x .. wall_z`` is where the merged wall reflects the same path. Metres, degrees, dB.
    """
    kept = table.isel(mpc=np.flatnonzero(table["accepted"].values))
    covariance = kept["point_covariance"].values
    n = np.deg2rad(kept["normal"].values)
    level = np.zeros_like(n)
    across, along = np.stack([np.cos(n), np.sin(n), level], axis=-1), np.stack([-np.sin(n), np.cos(n), level], axis=-1)
    columns = {name: kept[name].values for name in ("position", "wall")}
    for column, variable in (("rp", "reflection_point"), ("wall", "wall_point")):
        columns |= {f"{column}_{axis}": kept[variable].values[:, i] for i, axis in enumerate("xyz")}
    columns |= {
        f"std_{name}": np.sqrt(np.maximum(np.einsum("ni,nij,nj->n", way, covariance, way), 0))
        for name, way in (("along", along), ("across", across), ("up", np.broadcast_to([0.0, 0.0, 1.0], across.shape)))
    }
    columns |= {name: kept[name].values for name in ("normal", "tilt", "tilt_std")}
    columns["grazing"] = kept["grazing"].values.astype(int)
    columns |= {name: kept[name].values for name in ("delay", "azimuth", "path_gain", "reflection_loss")}
    with atomic_path(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*(column.tolist() for column in columns.values()), strict=True))
