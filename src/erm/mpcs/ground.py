"""Paths that met the ground on their way: each follows the same path without it."""

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from erm.common.constants import c
from erm.geometry.vertical import angle_difference
from erm.mpcs.reasons import Reason
from erm.mpcs.standard_errors import SIGMAS

if TYPE_CHECKING:
    import xarray as xr

BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.int64]


def is_ground_companion(table: "xr.Dataset") -> BoolArray:
    """Whether (mpc,) MPCs have the azimuth of a stronger one of their link, and the delay of it by way of the ground.

    A path off vertical faces with the length ``L`` has the length ``sqrt(L**2 + 4 z_tx z_rx)`` if it meets the ground
    as well, whatever the faces are. All are False where no reflection off the ground was received.

    Examples
    --------
    A pillar in a street, seen directly and by way of the ground, 2.2 m later, and a path of another direction:

    >>> import erm
    >>> link = {"position": "P1", "tx_position": [0.0, 0.0, 9.0], "rx_position": [30.0, 0.0, 1.5], "frequency": 60e9}
    >>> ground = (30**2 + 10.5**2) ** 0.5
    >>> lengths = np.array([ground, 32.0, (32.0**2 + 54) ** 0.5, (32.0**2 + 54) ** 0.5])
    >>> azimuth = np.array([180.0, 150.0, 150.0, 90.0])
    >>> columns = {"delay": lengths / c, "azimuth": azimuth, "path_gain": np.full(4, -130.0)}
    >>> table = erm.select(erm.make_table({name: np.tile(value, (4, 1)) if np.ndim(value) else np.full(4, value)
    ...                                    for name, value in link.items()} | columns))
    >>> is_ground_companion(table).tolist()
    [False, False, True, False]
    >>> table["delay_std"][:], table["azimuth_std"][:] = 1e-8, 3.0  # the way by the ground is not told from the other
    >>> is_ground_companion(table).tolist()
    [False, False, True, False]
    """
    return followed_by_ground(table) >= 0


def followed_by_ground(table: "xr.Dataset") -> IntArray:
    """Row (mpc,) of the MPC that each one follows by way of the ground, -1 for none; see `is_ground_companion`."""
    companion = np.full(table.sizes["mpc"], -1)
    if not np.any(table["reason"].values == Reason.GROUND_REFLECTION):
        return companion
    height = [
        table[name].values[:, 2] - table.attrs.get("ground_height", 0.0) for name in ("tx_position", "rx_position")
    ]
    length, azimuth, gain = table["delay"].values * c, table["azimuth"].values, table["path_gain"].values
    by_ground = np.sqrt(length**2 + 4 * height[0] * height[1])
    # both have the same errors of the survey
    length_std, azimuth_std = (
        unit * np.sqrt(np.maximum(table[f"{name}_std"].values ** 2 - table[f"survey_{name}_std"].values ** 2, 0.0))
        for unit, name in ((c, "delay"), (1.0, "azimuth"))
    )
    link = table["link"].values
    order = np.lexsort((length, link))
    for own in np.split(order, np.flatnonzero(np.diff(link[order])) + 1):
        later = own[:, None]
        late = (length[later] - by_ground[own]) / np.hypot(length_std[later], length_std[own])
        turned = angle_difference(azimuth[later], azimuth[own]) / np.hypot(azimuth_std[later], azimuth_std[own])
        # far away the way by the ground is hardly longer, and a path would be its own companion
        apart = np.hypot(late, turned)
        of_any = (apart < SIGMAS) & (gain[later] <= gain[own]) & (length[later] > length[own])
        nearest = np.argmin(np.where(of_any, apart, np.inf), axis=1)
        companion[own] = np.where(of_any.any(axis=1), own[nearest], -1)
    return companion
