"""Extend a map: read the MPCs that it was made from, and add those of new positions without a new search."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from erm.common.errors import DataError
from erm.common.storage import open_group
from erm.maps.formats import HDF5, read_map
from erm.mpcs.table import OPTIONAL, VALUES
from erm.reconstruction.model.paths import IntArray
from erm.reconstruction.search.search import NEW_MPC

if TYPE_CHECKING:
    import xarray as xr

GROUP = "/mpc"
COLUMNS = ("position", "los", "tx_position", "rx_position", "frequency", *VALUES, *OPTIONAL)


def with_images(table: "xr.Dataset", located: "xr.Dataset") -> "xr.Dataset":
    """Return the MPCs as measured, with common image, wall and reflection point, for `erm.maps.formats.write_map`.

    The reflection point is NaN where the MPC was not accepted as a single bounce.

    Parameters
    ----------
    table : xarray.Dataset
        MPC table that a map was made from.
    located : xarray.Dataset
        Table of `erm.reconstruct`.
    """
    point = located["reflection_point"].where(located["accepted"])
    return table[list(COLUMNS)].assign(image=located["image"], wall=located["wall"], reflection_point=point)


def read_map_mpcs(path: Path) -> tuple["xr.Dataset", IntArray]:
    """Read the MPCs that a map was made from, and the number (mpc,) of the common image of each, -1 for none.

    Raises
    ------
    DataError
        The file is not a map, or holds no MPCs.
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


def add_mpcs(stored: "xr.Dataset", image: IntArray, table: "xr.Dataset") -> tuple["xr.Dataset", IntArray]:
    """Add MPCs to those of a map. Antenna pairs that were measured again replace those of the map.

    Parameters
    ----------
    stored, image : xarray.Dataset, array (stored mpc,) of int
        From `read_map_mpcs`.
    table : xarray.Dataset
        MPC table to add.

    Returns
    -------
    table : xarray.Dataset
        MPC table of all.
    start : array (mpc,) of int
        For `erm.reconstruct`.
    """
    import xarray as xr

    ends = [np.hstack([one["tx_position"].values, one["rx_position"].values]) for one in (stored, table)]
    again = set(map(tuple, ends[1].tolist()))
    kept = np.flatnonzero([tuple(link) not in again for link in ends[0].tolist()])
    start = np.r_[image[kept], np.full(table.sizes["mpc"], NEW_MPC)]
    return xr.concat([stored.isel(mpc=kept), table], dim="mpc"), start
