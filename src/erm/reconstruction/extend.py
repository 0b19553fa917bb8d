"""A map with the components that it was made from: so that positions can be added to it without starting again."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from erm.common.errors import DataError
from erm.common.storage import open_group
from erm.maps.environment import Environment
from erm.mpcs.table import OPTIONAL, VALUES
from erm.reconstruction.model.paths import IntArray
from erm.reconstruction.search.search import FRESH

if TYPE_CHECKING:
    import xarray as xr

SUFFIXES = (".h5", ".hdf5", ".nc")
"""Of the formats that hold components beside the reflectors."""
GROUP = "/mpc"
COLUMNS = ("position", "los", "tx_position", "rx_position", "frequency", *VALUES, *OPTIONAL)


def write_map(environment: Environment, table: "xr.Dataset", located: "xr.Dataset", path: Path) -> None:
    """Write a map, and in formats of `SUFFIXES` its components.

    Parameters
    ----------
    environment, located : Environment, xarray.Dataset
        Of `erm.reconstruction.reconstruct.reconstruct`.
    table : xarray.Dataset
        MPC table that they were made from, as it was measured.
    path : path
        The suffix tells the format.
    """
    if path.suffix.lower() not in SUFFIXES:
        environment.write(path)
        return
    from erm.maps.formats import hdf5
    from erm.maps.formats.columns import to_columns, to_scene

    mpcs = table[list(COLUMNS)].assign(image=located["image"], wall=located["wall"])
    hdf5.write(to_columns(environment.reflectors), to_scene(environment), path, mpcs)


def read_members(path: Path) -> tuple["xr.Dataset", IntArray]:
    """Components that a map was made from, and the number (mpc,) of the common image of each, -1 for none.

    Raises
    ------
    DataError
        The file is none of a map, or holds no components.
    """
    advice = "expected a map that `erm reconstruct` wrote as .h5; give all MPCs instead"
    if path.suffix.lower() not in SUFFIXES:
        raise DataError(f"{path}: maps of this format hold no MPCs; {advice}")
    Environment.read(path)
    try:
        mpcs = open_group(path, GROUP)
        return mpcs[list(COLUMNS)], mpcs["image"].values
    except (DataError, KeyError):
        raise DataError(f"{path}: holds no MPCs; {advice}") from None


def added(stored: "xr.Dataset", image: IntArray, table: "xr.Dataset") -> tuple["xr.Dataset", IntArray]:
    """Components of a map and those to be added to it.

    Antenna pairs that were measured anew replace those of the map.

    Returns
    -------
    table : xarray.Dataset
        MPC table of all.
    start : array (mpc,)
        For `erm.reconstruction.reconstruct.reconstruct`.
    """
    import xarray as xr

    ends = [np.hstack([one["tx_position"].values, one["rx_position"].values]) for one in (stored, table)]
    anew = set(map(tuple, ends[1].tolist()))
    kept = np.flatnonzero([tuple(link) not in anew for link in ends[0].tolist()])
    start = np.r_[image[kept], np.full(table.sizes["mpc"], FRESH)]
    return xr.concat([stored.isel(mpc=kept), table], dim="mpc"), start
