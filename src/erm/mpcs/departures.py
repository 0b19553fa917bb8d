r"""Angles of departure: whether a path left the transmitter toward the point that arrival and delay show.

A path of length ``L`` that arrives from azimuth ``a`` and was reflected once met the point ``P(L, a)``. It left the
transmitter toward this point, whatever reflected it. A path that was reflected twice left toward another face. The
variance of the predicted azimuth of departure is, with the errors of length and azimuth of arrival,

.. math:: \sigma^2 = (\partial_L \sigma_L)^2 + (\partial_a \sigma_a)^2 .

The azimuth zero of the transmitter is common to all its paths; direct paths, which leave toward the receiver, show it.
"""

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from erm.common.constants import c
from erm.geometry import vertical
from erm.geometry.vertical import FloatArray, angle_difference, azimuth_of
from erm.mpcs.antenna_pairs import distinct_rows
from erm.mpcs.standard_errors import MIN_SAMPLE, SIGMAS
from erm.mpcs.table import path_length

if TYPE_CHECKING:
    import xarray as xr

BoolArray = npt.NDArray[np.bool_]


def single_reflection_departure(table: "xr.Dataset") -> tuple[FloatArray, FloatArray]:
    """Azimuth (mpc,) of departure of a single reflection, and its standard error [degree]; NaN where there is none.

    Parameters
    ----------
    table : xarray.Dataset
        MPC table with all standard errors of delays and azimuths.
    """
    tx, rx = table["tx_position"].values, table["rx_position"].values
    length, azimuth = path_length(table), table["azimuth"].values

    def departure(length: FloatArray, azimuth: FloatArray) -> FloatArray:
        point, _ = vertical.reflection_point(tx, rx, length, azimuth)
        return azimuth_of(point - tx[:, :2])

    found = departure(length, azimuth)
    by_length = angle_difference(departure(length + table["delay_std"].values * c, azimuth), found)
    by_azimuth = angle_difference(departure(length, azimuth + table["azimuth_std"].values), found)
    return found, np.hypot(by_length, by_azimuth)


def is_no_single_reflection(table: "xr.Dataset", direct: BoolArray) -> BoolArray:
    """Whether (mpc,) paths certainly left in another direction than a single reflection.

    Parameters
    ----------
    table : xarray.Dataset
        MPC table with all standard errors of delays and azimuths.
    direct : array (mpc,) of bool
        Direct paths.

    Examples
    --------
    >>> import erm
    >>> street = erm.Environment.walls([[[-60, 10], [60, 10]], [[-60, -12], [60, -12]]], top=40.0)
    >>> paths = erm.trace(street, (0, 0, 9), (20, -4, 2), 132e9, max_order=2)
    >>> table = erm.predict(street, (0, 0, 9), (20, -4, 2), 132e9)
    >>> table = table.assign(departure_azimuth=("mpc", paths["departure_azimuth"].values))
    >>> known = table.assign({f"{name}_std": ("mpc", [std] * table.sizes["mpc"]) for name, std in
    ...                       (("delay", 1e-10), ("azimuth", 0.5), ("departure_azimuth", 0.5))})
    >>> is_no_single_reflection(known, table["order"].values == 0).tolist() == (table["order"].values == 2).tolist()
    True
    """
    measured = table["departure_azimuth"].values
    if not np.isfinite(measured).any():
        return np.zeros(len(measured), dtype=bool)
    std = table["departure_azimuth_std"].values
    toward_rx = azimuth_of(table["rx_position"].values - table["tx_position"].values)
    zero, zero_std = _zeros(
        angle_difference(measured, toward_rx), direct, distinct_rows(table["tx_position"].values)[1]
    )
    expected, expected_std = single_reflection_departure(table)
    away = np.abs(angle_difference(measured - zero, expected))
    limit = SIGMAS * np.sqrt(std**2 + expected_std**2 + zero_std**2)
    return np.asarray((away > limit) & ~direct)


def _zeros(excess: FloatArray, direct: BoolArray, transmitter: npt.NDArray[np.int64]) -> tuple[FloatArray, FloatArray]:
    """Azimuth zero (mpc,) of each transmitter, and its standard error; 0 with fewer than `MIN_SAMPLE` direct paths.

    Parameters
    ----------
    excess : array (mpc,)
        Azimuth of departure from the direction of the receiver [degree].
    """
    zero, std = np.zeros(len(excess)), np.zeros(len(excess))
    for one in np.unique(transmitter):
        shown = excess[direct & (transmitter == one) & np.isfinite(excess)]
        if len(shown) >= MIN_SAMPLE:
            middle = float(np.median(shown))
            zero[transmitter == one] = middle
            std[transmitter == one] = np.std(shown - middle) / np.sqrt(len(shown))
    return zero, std
