"""The face that each MPC was reflected off, if it was reflected once."""

from typing import TYPE_CHECKING

import numpy as np

from erm.common.constants import c
from erm.geometry import vertical, vertical_covariance
from erm.geometry.sloped import sloped_covariance, sloped_face
from erm.geometry.vertical import FloatArray
from erm.mpcs import elevation
from erm.mpcs.standard_errors import SIGMAS
from erm.mpcs.table import path_length

if TYPE_CHECKING:
    import xarray as xr

FACE_COLUMNS = (
    *("normal", "offset", "tilt", "tilt_std", "grazing"),
    *("reflection_point", "point_covariance", "line_covariance"),
)
"""Columns of `with_faces`."""


def with_faces(table: "xr.Dataset") -> "xr.Dataset":
    """Return the table with the face of each MPC, if it was reflected once.

    The face is taken for vertical, but for ``tilt``, which the measured elevation gives. NaN where the path is not
    longer than the direct one.
    """
    tx, rx = table["tx_position"].values, table["rx_position"].values
    path = (tx, rx, path_length(table), table["azimuth"].values)
    std = (table["delay_std"].values * c, table["azimuth_std"].values)
    point, normal = vertical.reflection_point(*path)
    _, offset = vertical.face_line(*path)
    in_space = (*path, table["elevation"].values)
    errors = np.stack([*std, table["elevation_std"].values], axis=-1)[:, :, None] ** 2 * np.eye(3)
    _, slope = sloped_covariance(*in_space, errors)
    excess = path[2] - np.linalg.norm(tx - rx, axis=-1)
    columns = {
        "normal": (normal, "degree", "azimuth of the face normal"),
        "offset": (offset, "m", "distance of the face from the origin along its normal"),
        "tilt": (sloped_face(*in_space).tilt, "degree", "elevation of the face normal by the measured elevation"),
        "tilt_std": (np.sqrt(slope[:, 1, 1]), "degree", "standard deviation of the tilt"),
        "grazing": (
            ~(excess > SIGMAS * std[0]),
            "1",
            "path hardly longer than the direct one: the errors of its face are unreliable",
        ),
    }
    return table.assign(
        {name: ("mpc", values, {"units": unit, "long_name": text}) for name, (values, unit, text) in columns.items()}
        | {
            "reflection_point": (
                ("mpc", "xyz"),
                np.column_stack([point, vertical.bounce_height(*path)]),
                {"units": "m", "long_name": "reflection point if the path was reflected once"},
            ),
            "point_covariance": (
                ("mpc", "xyz", "xyz_2"),
                vertical_covariance.point_covariance(*path, *std),
                {"units": "m2"},
            ),
            "line_covariance": (("mpc", "parameter", "parameter_2"), vertical_covariance.line_covariance(*path, *std)),
        }
    )


def elevation_excess(table: "xr.Dataset") -> FloatArray:
    """Elevation (mpc,) minus that of a path off vertical walls [degree]; NaN where it is unknown."""
    return np.asarray(table["elevation"].values - elevation.vertical_face_elevation(table))
