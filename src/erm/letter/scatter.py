"""Scatter of the path length that explains the letter's errors when heights are taken into account.

The planar equations move all points of a face in the same direction. They cannot explain printed errors on both sides
of a face, or smaller errors. Here these are modelled by a normal error of the path length. Its standard deviation is
fitted to the RMSE; mean and standard deviation of the error follow and can be compared with the printed ones. Where
these differ, a bias that all paths of the route share is fitted as well, to the mean and the standard deviation.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from erm.common.constants import c
from erm.evaluation.outline import summary
from erm.geometry.vertical import FloatArray, reflection_point
from erm.letter.published import (
    COLUMN_OF_ROUTE,
    EAST_BUILDING_LINE,
    ROUTE_1_POINTS,
    ROUTE_2_ORDINATES,
    ROUTE_2_WALLS,
    TABLE_2,
    TABLE_3,
)
from erm.letter.routes import Study, across

DRAWS, SEED = 200, 3  # draws for each component. Chosen; not derived
BISECTIONS = 30  # of the interval of the standard deviation; 20 m / 2**30 is 0.02 um
MAX_LENGTH_ERROR = 20.0  # m; upper bound of the fit, far over the printed errors


@dataclass(frozen=True)
class Scatter:
    """Errors of a route by a normal error of the path length.

    Parameters
    ----------
    route : str
    rmse : float
        RMSE of the letter: root of the sum of squares of the printed mean and standard deviation [m].
    length_std : float
        Standard deviation of the length that gives this RMSE [m].
    mean, std : float
        Mean and standard deviation of the errors that follow [m].
    planar : float
        Signed mean error by the planar equations, positive behind the face [m].
    bias, beside : float
        Shared bias of the lengths and standard deviation about it, fitted to the printed mean and standard deviation
        of the errors [m].
    biased_mean, biased_std : float
        Mean and standard deviation of the errors that follow from these [m].
    """

    route: str
    rmse: float
    length_std: float
    mean: float
    std: float
    planar: float
    bias: float
    beside: float
    biased_mean: float
    biased_std: float


def scatter(studied: Study) -> list[Scatter]:
    """Fit the error of the path length to the RMSE of each route, on the components on walls."""
    found = []
    for route, column in COLUMN_OF_ROUTE.items():
        printed = TABLE_3[column]
        rmse = float(np.hypot(printed["mean"], printed["RMSE"]))
        chosen = studied.on_walls & studied.of(list(TABLE_2[route]))
        if not chosen.any():
            continue
        normal = np.random.default_rng(SEED).standard_normal((DRAWS, np.count_nonzero(chosen)))
        low, high = 0.0, MAX_LENGTH_ERROR
        for _ in range(BISECTIONS):
            middle = (low + high) / 2
            low, high = (middle, high) if _errors(studied, chosen, middle * normal)["rmse"] < rmse else (low, middle)
        made = _errors(studied, chosen, high * normal)
        planar = float(np.mean(across(studied, chosen, _points(studied, chosen, planar=True))))
        biased = _with_bias(studied, chosen, normal, (printed["mean"], printed["RMSE"]))
        found.append(Scatter(route, rmse, high, made["mean"], made["std"], planar, *biased))
    return found


def _with_bias(
    studied: Study, chosen: npt.NDArray[np.bool_], normal: FloatArray, printed: tuple[float, float]
) -> tuple[float, float, float, float]:
    """Bias of the lengths, standard deviation about it, and the mean and standard deviation that follow [m]."""

    def made(size: FloatArray) -> FloatArray:
        errors = _errors(studied, chosen, size[0] + size[1] * normal)
        return np.array([errors["mean"], errors["std"]])

    def departure(size: FloatArray) -> FloatArray:
        return made(size) - printed

    fitted = least_squares(departure, printed, bounds=(0, MAX_LENGTH_ERROR)).x
    mean, std = made(fitted)
    return float(fitted[0]), float(fitted[1]), float(mean), float(std)


def printed_signs() -> dict[str, FloatArray]:
    """Signed errors of the printed points, positive behind the face [m]."""
    slope, intercept = EAST_BUILDING_LINE
    x, y = ROUTE_1_POINTS.T
    south = np.where(ROUTE_2_WALLS[0] == ROUTE_2_WALLS, -1.0, 1.0)  # the first point is on the northern wall
    return {
        "Route 1": (y - slope * x - intercept) / np.hypot(1, slope),
        "Route 2": south * (ROUTE_2_ORDINATES - ROUTE_2_WALLS),
    }


def _errors(studied: Study, chosen: npt.NDArray[np.bool_], late: FloatArray) -> dict[str, float]:
    """Summary of ``D_Error`` over draws of length errors (draw, component) [m]."""
    values = np.abs(across(studied, chosen, _points(studied, chosen, late)))
    return summary(values[np.isfinite(values)])


def _points(
    studied: Study, chosen: npt.NDArray[np.bool_], late: FloatArray | float = 0.0, *, planar: bool = False
) -> FloatArray:
    kept = studied.table.isel(mpc=np.flatnonzero(chosen))
    ends = kept["tx_position"].values, kept["rx_position"].values
    return reflection_point(*ends, kept["delay"].values * c + late, kept["azimuth"].values, planar=planar)[0]
