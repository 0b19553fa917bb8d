"""Reflection points on disk."""

import csv
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from erm.common.atomic import atomic_path

if TYPE_CHECKING:
    import xarray as xr


def write_reflection_points(table: "xr.Dataset", path: Path | str) -> None:
    """Write the reflection points of accepted MPCs as CSV, with their errors and their walls.

    ``std_along``, ``std_across`` and ``std_up`` are the standard errors along the face, across it, and of the height.
    ``wall_x .. wall_z`` is the point where the merged wall reflects the path. Metres, degrees, dB.

    Parameters
    ----------
    table : xarray.Dataset
        Table of `erm.reconstruct`.
    path : path
        The file.
    """
    kept = table.isel(mpc=np.flatnonzero(table["accepted"].values))
    covariance = kept["point_covariance"].values
    n = np.deg2rad(kept["normal"].values)
    zero = np.zeros_like(n)
    across, along = np.stack([np.cos(n), np.sin(n), zero], axis=-1), np.stack([-np.sin(n), np.cos(n), zero], axis=-1)
    columns = {name: kept[name].values for name in ("position", "wall")}
    for column, variable in (("rp", "reflection_point"), ("wall", "wall_point")):
        columns |= {f"{column}_{axis}": kept[variable].values[:, i] for i, axis in enumerate("xyz")}
    up = np.broadcast_to([0.0, 0.0, 1.0], across.shape)
    columns |= {
        f"std_{name}": np.sqrt(np.maximum(np.einsum("ni,nij,nj->n", direction, covariance, direction), 0))
        for name, direction in (("along", along), ("across", across), ("up", up))
    }
    columns |= {name: kept[name].values for name in ("normal", "tilt", "tilt_std")}
    columns["grazing"] = kept["grazing"].values.astype(int)
    columns |= {name: kept[name].values for name in ("delay", "azimuth", "path_gain", "reflection_loss")}
    with atomic_path(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*(column.tolist() for column in columns.values()), strict=True))
