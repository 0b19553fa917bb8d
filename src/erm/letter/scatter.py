"""Which scatter of the path length makes the letter's errors, once heights are taken into account.

The planar reading moves all points of a face the same way. Errors that are printed on both sides of a face, or too
small for it, must come from something else; here, from lengths that are off by a normal error. Its size is chosen such
that the RMSE comes out; mean and standard deviation then follow, and can be compared with what is printed. Where they
differ, a bias of the lengths that all paths of the route share is fitted beside it, to the mean and the standard
deviation.
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

DRAWS, SEED = 200, 3
STEPS = 30  # halvings of the interval that holds the size
WIDEST = 20.0  # m


@dataclass(frozen=True)
class Scatter:
    """What lengths with a normal error make of a route.

    Parameters
    ----------
    route : str
    rmse : float
        Of the letter: root of the sum of squares of the printed mean and standard deviation [m].
    length_std : float
        Of the lengths, that gives this RMSE [m].
    mean, std : float
        Of the errors that follow [m].
    planar : float
        Mean with its sign, positive behind the face, by the planar reading of the components as they are [m].
    bias, beside : float
        Of the lengths: what all share, and the standard deviation about it, that give the printed mean and standard
        deviation most nearly [m].
    biased_mean, biased_std : float
        Of the errors that follow from these [m].
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
    """Fit the error of the path length to each route's RMSE, on the components that make its walls."""
    found = []
    for route, column in COLUMN_OF_ROUTE.items():
        printed = TABLE_3[column]
        rmse = float(np.hypot(printed["mean"], printed["RMSE"]))
        chosen = studied.on_walls & studied.of(list(TABLE_2[route]))
        if not chosen.any():
            continue
        normal = np.random.default_rng(SEED).standard_normal((DRAWS, np.count_nonzero(chosen)))
        low, high = 0.0, WIDEST
        for _ in range(STEPS):
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
    """Bias, standard deviation of the lengths beside it, and the mean and standard deviation that follow [m]."""

    def made(size: FloatArray) -> FloatArray:
        errors = _errors(studied, chosen, size[0] + size[1] * normal)
        return np.array([errors["mean"], errors["std"]])

    def departure(size: FloatArray) -> FloatArray:
        return made(size) - printed

    fitted = least_squares(departure, printed, bounds=(0, WIDEST)).x
    mean, std = made(fitted)
    return float(fitted[0]), float(fitted[1]), float(mean), float(std)


def printed_signs() -> dict[str, FloatArray]:
    """Errors of the printed points with their signs, positive behind the face, where points are printed [m]."""
    slope, intercept = EAST_BUILDING_LINE
    x, y = ROUTE_1_POINTS.T
    south = np.where(ROUTE_2_WALLS[0] == ROUTE_2_WALLS, -1.0, 1.0)  # the first is off the northern wall
    return {
        "Route 1": (y - slope * x - intercept) / np.hypot(1, slope),
        "Route 2": south * (ROUTE_2_ORDINATES - ROUTE_2_WALLS),
    }


def _errors(studied: Study, chosen: npt.NDArray[np.bool_], late: FloatArray) -> dict[str, float]:
    """Summary of ``D_Error`` over draws of errors (draw, component) of the length [m]."""
    values = np.abs(across(studied, chosen, _points(studied, chosen, late)))
    return summary(values[np.isfinite(values)])


def _points(
    studied: Study, chosen: npt.NDArray[np.bool_], late: FloatArray | float = 0.0, *, planar: bool = False
) -> FloatArray:
    kept = studied.table.isel(mpc=np.flatnonzero(chosen))
    ends = kept["tx_position"].values, kept["rx_position"].values
    return reflection_point(*ends, kept["delay"].values * c + late, kept["azimuth"].values, planar=planar)[0]
