"""Environment as netCDF4-compatible HDF5: the reflector table with units; properties of the scene as attributes."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from erm.common.errors import DataError
from erm.common.gate.hdf5 import open_hdf5
from erm.common.gate.nesting import parse_json
from erm.common.storage import open_group, write_product
from erm.maps.formats.columns import CENTRE, COVARIANCES, DEFAULTS, ENDS, UNSEEN, Columns

if TYPE_CHECKING:
    import xarray as xr

UNITS = (
    dict.fromkeys((*ENDS, *CENTRE, *UNSEEN, "radius", "radius_std", "base", "top", "offset", "relief"), "m")
    | dict.fromkeys(("normal", "tilt"), "degree")
    | dict(zip(COVARIANCES, ("degree2", "degree m", "m2", "m2", "m2", "m2"), strict=True))
)
SCENE = ("ground", "ceiling", "materials", "georeference")


def write(
    columns: Columns, scene: dict[str, Any], path: Path, groups: "Mapping[str, xr.Dataset | None] | None" = None
) -> None:
    """Write columns as variables along ``reflector``. Ground, ceiling and materials are JSON attributes.

    Each of ``groups`` that is not None is written, too.
    """
    import xarray as xr

    table = xr.Dataset(
        {
            name: ("reflector", values.astype(object) if values.dtype.kind == "U" else values)
            for name, values in columns.items()
        },
        attrs=scene["attributes"] | {name: json.dumps(scene[name]) for name in SCENE},
    )
    for name in columns:
        if name in UNITS:
            table[name].attrs["units"] = UNITS[name]
        elif name in ("kind", "material"):
            table[name].encoding["dtype"] = str  # an empty table of objects does not tell that it holds text
    others = {name: group for name, group in (groups or {}).items() if group is not None}
    write_product({"/": table} | others, path)


def read_group(path: Path, name: str) -> "xr.Dataset | None":
    """Group of a file of `write`; None if it has none of that name."""
    with open_hdf5(path) as file:
        there = name.strip("/") in file
    return open_group(path, name) if there else None


def _plain(value: Any) -> Any:
    """Attribute of a file of anybody as text formats can hold it."""
    try:
        return json.loads(json.dumps(value.tolist() if hasattr(value, "tolist") else value, allow_nan=False))
    except (TypeError, ValueError):  # what JSON cannot write
        return str(value)


def read(path: Path) -> tuple[Columns, dict[str, Any]]:
    """Read a file of `write`."""
    table = open_group(path)
    if "reflector" not in table.dims:
        raise DataError(f"{path}: holds no reflectors; expected an environment")
    attributes = {name: _plain(value) for name, value in table.attrs.items()}
    try:
        scene = {name: parse_json(attributes.pop(name, "null")) for name in SCENE}
    except (TypeError, ValueError) as error:
        raise DataError(f"{path}: attributes of the scene are not JSON ({error}); write the map again") from error
    columns = {name: np.asarray(table[name].values) for name in (*ENDS, *DEFAULTS) if name in table}
    for name in columns:
        if table[name].dims != ("reflector",):
            raise DataError(f"{path}: {name} has the axes {table[name].dims}; expected one value a reflector")
    return columns, scene | {"attributes": attributes}
