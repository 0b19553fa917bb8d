"""A map with the components that it was made from: so that positions can be added to it without starting again."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from erm.common.errors import DataError
from erm.common.storage import open_group
from erm.maps.formats import HDF5, read_map
from erm.mpcs.table import OPTIONAL, VALUES
from erm.reconstruction.model.paths import IntArray
from erm.reconstruction.search.search import FRESH

if TYPE_CHECKING:
    import xarray as xr

GROUP = "/mpc"
COLUMNS = ("position", "los", "tx_position", "rx_position", "frequency", *VALUES, *OPTIONAL)


def with_images(table: "xr.Dataset", located: "xr.Dataset") -> "xr.Dataset":
    """MPCs as measured, each with its common image and its wall, for `erm.maps.formats.write_map`.

    Parameters
    ----------
    table : xarray.Dataset
        MPC table that a map was made from.
    located : xarray.Dataset
        Table of `erm.reconstruction.reconstruct.reconstruct`.
    """
    return table[list(COLUMNS)].assign(image=located["image"], wall=located["wall"])


def read_members(path: Path) -> tuple["xr.Dataset", IntArray]:
    """Components that a map was made from, and the number (mpc,) of the common image of each, -1 for none.

    Raises
    ------
    DataError
        The file is none of a map, or holds no components.
    """
    advice = "expected a map that `erm reconstruct` wrote as .h5; give all MPCs instead"
    if path.suffix.lower() not in HDF5:
        raise DataError(f"{path}: maps of this format hold no MPCs; {advice}")
    read_map(path)
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
