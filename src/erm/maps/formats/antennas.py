"""Points that a map was made from: antennas and reflection points, with the fields that a GIS program shows."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from erm.geometry.vertical import FloatArray

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class Points:
    """Shapes of one layer.

    Attributes
    ----------
    places : sequence of array (point, 2)
        East and north of each shape [m].
    fields : dict of array (shape,)
        Fields by name.
    """

    places: Sequence[FloatArray]
    fields: dict[str, np.ndarray]


def reflection_points(mpcs: "xr.Dataset | None") -> dict[str, Points]:
    """Layer ``reflection_points`` of the MPCs (of `erm.reconstruction.extend.with_images`) that made the map.

    Fields: ``position``, ``reflector`` (its number in the map), ``height`` [m], and of the MPC ``delay`` [s],
    ``azimuth`` [degree], ``path_gain`` [dB].
    """
    if mpcs is None or "reflection_point" not in mpcs:
        return {}
    kept = mpcs.isel(mpc=np.flatnonzero(np.isfinite(mpcs["reflection_point"].values).all(axis=-1)))
    points = kept["reflection_point"].values
    fields = {
        "position": kept["position"].values.astype(str),
        "reflector": kept["wall"].values,
        "height": points[:, 2],
        **{name: kept[name].values for name in ("delay", "azimuth", "path_gain")},
    }
    return {"reflection_points": Points(list(points[:, None, :2]), fields)}


def antenna_points(mpcs: "xr.Dataset | None", positions: "xr.Dataset | None" = None) -> dict[str, Points]:
    """Layers ``tx`` and ``rx`` of an MPC table: ``height`` [m]; each RX names its position and its TX.

    With ``positions`` (of `erm.survey.position_files.positions_of`) the receivers are where the map has them, and
    the errors of heading [degree] and clock [s] are fields, too.
    """
    if mpcs is None or not mpcs.sizes["mpc"]:
        return {}
    names, first = np.unique(mpcs["position"].values.astype(str), return_index=True)
    tx, number = np.unique(mpcs["tx_position"].values[first], axis=0, return_inverse=True)
    number = number.reshape(-1)  # of two axes in numpy 2.0
    rx, fields = mpcs["rx_position"].values[first], {"position": names, "tx": number}
    if positions is not None:
        row = {str(name): row for row, name in enumerate(positions["name"].values)}
        rows = [row[name] for name in names if name in row]
        if len(rows) == len(names):
            rx = positions["rx"].values[rows]
            fields |= {name: positions[name].values[rows] for name in ("heading", "heading_std", "clock", "clock_std")}
    return {
        "tx": Points(list(tx[:, None, :2]), {"tx": np.arange(len(tx)), "height": tx[:, 2]}),
        "rx": Points(list(rx[:, None, :2]), fields | {"height": rx[:, 2]}),
    }
