"""Positions of a campaign without the errors of its survey, on disk."""

import csv
from pathlib import Path
from typing import TYPE_CHECKING

from erm.common.atomic import atomic_path

if TYPE_CHECKING:
    import xarray as xr


def positions_of(located: "xr.Dataset") -> "xr.Dataset":
    """Positions of a map, one row each, of the table of `erm.reconstruction.make_map.make_map`."""
    names = [name for name, column in located.items() if "survey_position" in column.dims]
    return located[names].rename({name: str(name).removeprefix("survey_") for name in names})


def write_positions(located: "xr.Dataset", path: Path | str) -> None:
    """Write positions without the errors of the survey, these errors, and their standard errors, as CSV.

    ``rx_x .. rx_z`` is where the receiver stood, ``heading`` and ``clock`` are the errors of its azimuths (measured
    minus true) and delays. Metres, degrees, seconds.

    Parameters
    ----------
    located : xarray.Dataset
        Table of `erm.reconstruction.make_map.make_map`.
    path : path
        The file.
    """
    table = positions_of(located)
    columns = {"position": table["name"].values}
    columns |= {f"rx_{axis}": table["rx"].values[:, i] for i, axis in enumerate("xyz")}
    columns |= {f"rx_{axis}_correction": table["rx_correction"].values[:, i] for i, axis in enumerate("xy")}
    columns |= {f"rx_{axis}_std": table["rx_std"].values[:, i] for i, axis in enumerate("xy")}
    columns |= {name: table[name].values for name in ("heading", "heading_std", "clock", "clock_std")}
    with atomic_path(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*(column.tolist() for column in columns.values()), strict=True))
