"""The table of multipath components (MPCs): one `xarray.Dataset` along ``mpc``, one row per component.

One table holds any number of positions and transmitters; `erm.mpcs.files` reads and writes it.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from erm.common.constants import c
from erm.common.errors import DataError

if TYPE_CHECKING:
    import xarray as xr

VALUES = {"delay": "s", "azimuth": "degree", "elevation": "degree", "path_gain": "dB"}
"""Measured columns and their units."""
OPTIONAL = {f"{name}_std": unit for name, unit in VALUES.items()} | {
    "gain_slope": "dB degree-1",
    "gain_curvature": "dB degree-2",
    "wrap_period": "s",
    "departure_azimuth": "degree",
    "departure_elevation": "degree",
    "departure_azimuth_std": "degree",
    "departure_elevation_std": "degree",
}
"""Columns that may be absent, and their units."""

SHORTEST = 1e-3
"""Shortest length of a path [m]: with a wrong clock delays may be negative, and a length of 0 has no gain."""

Columns = Mapping[str, npt.ArrayLike]


def make_table(columns: Columns) -> "xr.Dataset":
    """Make an MPC table from arrays. Single values apply to all rows.

    Parameters
    ----------
    columns : mapping
        Arrays by column name. Required: ``position`` (name), ``tx_position`` and ``rx_position`` (mpc, 3) or (3,) [m],
        ``frequency`` [Hz], ``delay`` [s], ``azimuth`` [degree], ``path_gain`` [dB]. Optional: ``los`` (1 line of
        sight, 0 none, -1 unknown), ``elevation`` [degree], and the columns of `OPTIONAL`: standard deviations
        (``_std``), unknown if they are not positive; ``gain_slope`` [dB/degree] and ``gain_curvature`` [dB/degree2],
        the first and second derivative of the path gain with the assumed elevation; ``wrap_period`` [s], where the
        delay may be too short by a multiple of this period; ``departure_azimuth`` and ``departure_elevation``
        [degree], from the transmitter toward the first interaction.

    Returns
    -------
    xarray.Dataset
        Dimension ``mpc``; its length is 0 if the columns are empty.

    Examples
    --------
    >>> import erm
    >>> link = {"position": "RX1", "tx_position": [0, 0, 28.4], "rx_position": [31, -60, 1.4], "frequency": 132e9}
    >>> table = erm.make_table(link | {"delay": [2.4e-7, 3.1e-7], "azimuth": [117.0, 203.5], "path_gain": [-112, -121]})
    >>> table.sizes["mpc"], table["elevation"].values.tolist()
    (2, [nan, nan])
    """
    import xarray as xr

    given = {name: np.asarray(column) for name, column in columns.items()}
    if missing := [name for name in ("position", "tx_position", "rx_position") if name not in given]:
        raise DataError(f"no column {', '.join(missing)}; an MPC table needs the name and the places of its antennas")
    count = next((column.shape[0] for name, column in given.items() if name in VALUES and column.ndim), 1)
    table: dict[str, tuple[tuple[str, ...], npt.NDArray, dict[str, str]]] = {
        "position": (("mpc",), np.broadcast_to(given["position"], count).astype(np.str_), {}),
        "los": (
            ("mpc",),
            np.broadcast_to(given.get("los", np.int8(-1)), count).astype(np.int8),
            {"long_name": "line of sight: 1 yes, 0 no, -1 unknown"},
        ),
    }
    for end in ("tx_position", "rx_position"):
        value = np.broadcast_to(given[end].astype(float), (count, 3))
        table[end] = (("mpc", "xyz"), value.copy(), {"units": "m"})
    units = {"frequency": "Hz"} | VALUES | OPTIONAL
    for name, unit in units.items():
        value = np.broadcast_to(given.get(name, np.asarray(np.nan)).astype(float), count).copy()
        if name.endswith("_std"):
            value[value <= 0] = np.nan
        table[name] = (("mpc",), value, {"units": unit})
    return xr.Dataset(table)


def empty_table() -> "xr.Dataset":
    """Make a table without rows."""
    nothing = np.empty(0)
    return make_table(
        {"position": nothing.astype(str), "tx_position": np.empty((0, 3)), "rx_position": np.empty((0, 3))}
        | {"delay": nothing, "azimuth": nothing, "path_gain": nothing, "frequency": nothing}
    )


def columns_of_product(mpc: "xr.Dataset") -> dict[str, npt.NDArray]:
    """Columns for `make_table` of the ``/mpc`` group of a product.

    ``wrap_period`` is the sounder's period where ``may_be_wrapped`` is 1, else NaN.
    """
    columns = {name: mpc[name].values for name in (*VALUES, *OPTIONAL) if name in mpc}
    if "may_be_wrapped" in mpc:
        period = mpc.attrs.get("period", np.nan)
        columns["wrap_period"] = np.where(mpc["may_be_wrapped"].values == 1, period, np.nan)
    return columns


def path_length(table: "xr.Dataset") -> npt.NDArray[np.float64]:
    """Length (mpc,) of each path: delay times the speed of light [m], but at least `SHORTEST`."""
    return np.maximum(table["delay"].values * c, SHORTEST)


def free_space_gain(length: npt.ArrayLike, frequency: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Path gain (...) in free space: ``20 lg(c / (4 pi f L))`` [dB].

    Parameters
    ----------
    length : array (...)
        Path length ``L`` [m], at least `SHORTEST`.
    frequency : array (...)
        Carrier frequency ``f`` [Hz].
    """
    length = np.maximum(length, SHORTEST)
    return np.asarray(20 * np.log10(c / np.asarray(frequency) / (4 * np.pi * length)))
