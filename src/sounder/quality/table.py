"""The table of remarks: group ``/quality`` of a product."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from sounder.remark import Code, Remark

if TYPE_CHECKING:
    import xarray as xr

LABELS = {code.label: code for code in Code}
DIRECTION = {"azimuth": "horn azimuth", "elevation": "horn elevation"}


def tabulate_remarks(remarks: Sequence[Remark]) -> "xr.Dataset":
    """Table of the remarks of a position, in their order.

    Returns
    -------
    xarray.Dataset
        Along ``remark``, possibly of length 0: ``code``; ``azimuth`` and ``elevation`` [degree], NaN if the whole
        position is concerned; ``snapshot``, -1 for all; ``figure`` and the ``bound`` that it broke, in ``unit``;
        ``meaning``, what is wrong; ``action``, what was done or is to be done; ``failure``, 1 if the data failed, 0
        for a note.

    Examples
    --------
    >>> table = tabulate_remarks([Remark(Code.CLIPPED, azimuth=10.0, elevation=0.0, figure=0.02, bound=0.001)])
    >>> table["code"].item(), table["figure"].item(), table["action"].item()
    ('clipped', 0.02, 'left out; lower the receiver gain')
    >>> read_remarks(table)[0].code.name
    'CLIPPED'
    """
    import xarray as xr  # slow to import; `sounder info` only reads

    columns: dict[str, tuple[list[Any], Any, dict[str, str]]] = {
        "code": ([remark.code.label for remark in remarks], object, {}),
        **{
            name: ([getattr(remark, name) for remark in remarks], float, {"units": "degree", "long_name": long_name})
            for name, long_name in DIRECTION.items()
        },
        "snapshot": ([remark.snapshot for remark in remarks], np.int64, {"long_name": "first snapshot, -1 for all"}),
        "figure": ([remark.figure for remark in remarks], float, {"long_name": "measured figure"}),
        "bound": ([remark.bound for remark in remarks], float, {"long_name": "bound that the figure broke"}),
        "unit": ([remark.code.value.unit for remark in remarks], object, {"long_name": "unit of figure and bound"}),
        "meaning": ([remark.meaning for remark in remarks], object, {}),
        "action": ([remark.code.action for remark in remarks], object, {}),
        "failure": ([remark.code.value.fails for remark in remarks], np.int8, {"long_name": "1 failure, 0 note"}),
    }
    return xr.Dataset(
        {name: ("remark", np.array(values, dtype=kind), attrs) for name, (values, kind, attrs) in columns.items()}
    )


def read_remarks(table: Mapping[Any, Any]) -> list[Remark]:
    """Remarks of a table, a dataset or an open HDF5 group.

    Raises
    ------
    KeyError
        A column is missing, or a code is not known: another version made the table.
    """
    remarks = []
    for row in rows(table, ""):
        code = LABELS[row["code"]]
        numbers = {name: math.nan if row[name] is None else row[name] for name in ("figure", "bound", *DIRECTION)}
        detail = "" if row["meaning"] == code.text else row["meaning"]
        remarks.append(Remark(code, **numbers, snapshot=row["snapshot"], detail=detail))
    return remarks


def rows(table: Mapping[Any, Any], position: str) -> list[dict[str, Any]]:
    """Rows of a table as plain values for JSON, NaN as None; also of an open HDF5 group.

    Parameters
    ----------
    table : mapping
        Dataset or open HDF5 group.
    position : str
        Name of the position, for the first column.
    """
    names = ("code", "azimuth", "elevation", "snapshot", "figure", "bound", "unit", "meaning", "action", "failure")
    columns = [[_plain(value) for value in np.asarray(table[name]).tolist()] for name in names]
    return [{"position": position, **dict(zip(names, row, strict=True))} for row in zip(*columns, strict=True)]


def _plain(value: Any) -> Any:
    if isinstance(value, bytes):
        return value.decode(errors="replace")
    return None if isinstance(value, float) and math.isnan(value) else value
