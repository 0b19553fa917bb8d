"""The letter's published reflection points, and its Table 3 computed from them.

Chang et al., "Environment Reconstruction with Multi-targets Reflectors-merged Sensing Method Based on THz
Single-sided Channel Characteristics". Its frame has the transmitter at the origin, x east and y **south**. The
numbers here are as printed; `east_north` converts them to this software's frame.

The printed formulas reproduce the printed numbers only with these corrections:

- the face is ``L(x) = a x + b``; the letter prints ``a_L x + a_L``;
- ``D_Error = |y - a x - b| / sqrt(1 + a**2)``; the letter prints a plus sign, ``b_a`` and no root;
- what Table 3 calls RMSE is the standard deviation: an RMSE cannot be below the mean;
- the largest error of route 1 is 3.77 m; the letter prints 3.76.

The reflection points of the columns Canyon and Porch (routes 3 and 4), and the eastings of route 2, are not printed.
These columns and a full map of route 2 can therefore not be reproduced.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from erm.evaluation.outline import summary
from erm.geometry.vertical import FloatArray

EAST_BUILDING = np.array([[46.78, 46.57], [41.10, 106.57]])  # m, two measured points of its face
EAST_BUILDING_LINE = (-10.56, 540.72)  # slope and intercept [m], as printed
ROUTE_1_POINTS = np.array(
    [
        [46.40, 36.35],
        [45.45, 42.91],
        [46.09, 50.36],
        [50.53, 47.11],
        [44.58, 64.38],
        [47.51, 65.90],
        [40.87, 75.03],
        [43.46, 82.92],
        [45.87, 83.43],
        [42.66, 89.26],
    ]
)
ROUTE_2_ORDINATES = np.array([53.94, 65.80, 65.73, 65.89, 65.90, 65.86, 65.31, 67.01])  # m
ROUTE_2_WALLS = np.array([53.38, *[65.30] * 7])  # m, ordinate of the wall of each point
CORRIDOR_WALLS = {"sidewalk wall": 53.38, "teaching building": 50.38, "south corridor wall": 65.30}  # m
STATISTICS = {"min": "min", "max": "max", "mean": "mean", "RMSE": "std"}  # the letter's name: the true statistic
TABLE_3: Mapping[str, Mapping[str, float]] = {
    "Route 1": {"min": 0.09, "max": 3.76, "mean": 1.62, "RMSE": 1.28},
    "Route 2": {"min": 0.01, "max": 1.71, "mean": 0.62, "RMSE": 0.45},
    "Canyon": {"min": 1.00, "max": 4.44, "mean": 2.52, "RMSE": 1.28},
    "Porch": {"min": 0.37, "max": 1.87, "mean": 1.10, "RMSE": 0.51},
}
TABLE_2: Mapping[str, Mapping[str, float]] = {
    "Route 1": dict(
        zip(
            [f"RX{i}_L" for i in range(1, 11)],
            [62.2, 66.0, 70.0, 74.1, 78.3, 87.0, 95.9, 105.0, 114.3, 111.9],
            strict=True,
        )
    ),
    "Route 2": dict(zip([f"RX{i}_N" for i in range(1, 8)], [83.4, 78.0, 80.6, 83.3, 83.6, 83.1, 87.9], strict=True)),
    "Route 3": dict(
        zip(
            [f"RX{i}_L" for i in range(11, 22)],
            [57.3, 65.0, 73.3, 81.9, 90.8, 99.9, 105.6, 97.0, 98.7, 92.3, 103.0],
            strict=True,
        )
    ),
    "Route 4": dict(zip([f"RX{i}_N" for i in range(8, 13)], [98.8, 102.0, 105.4, 108.2, 105.6], strict=True)),
}
"""Distance between TX and RX [m] at every position of a route."""
COLUMN_OF_ROUTE = {"Route 1": "Route 1", "Route 2": "Route 2", "Route 3": "Porch", "Route 4": "Canyon"}
ROOM_ERRORS = {"min": 0.0016, "max": 0.187, "mean": 0.02, "rmse": 0.03, "small": 0.85}
"""Errors of the ray-tracing verification [m]; ``small`` is the share under 0.02 m ("almost" 85 %)."""
TABLE_1: Mapping[str, tuple[str, str]] = {
    "TX/RX height": ("4/2 m", "28.4/1.4 m"),
    "Centre frequency": ("300 GHz", "132 GHz"),
    "Bandwidth": ("1.2 GHz", "1.2 GHz"),
    "TX/RX antenna gain": ("0 dBi", "24.5 dBi"),
    "Horizontal/vertical HPBW": ("360/180°", "10/9°"),
    "RX azimuth rotation": ("-", "[0°: 10: 360°)"),
    "RX elevation rotation": ("-", "[-9°: 9: 9°]"),
}
"""Set-ups of simulation and measurement."""


@dataclass(frozen=True)
class Entry:
    """One number of Table 3 and the same recomputed from the published points.

    Parameters
    ----------
    scenario : str
        Column of the table.
    statistic : str
        Name of the statistic.
    printed : float
        As in the letter [m]; NaN if it is not printed.
    recomputed : float
        From the published points [m]; NaN if these are not printed.
    """

    scenario: str
    statistic: str
    printed: float
    recomputed: float


def east_north(points: npt.ArrayLike) -> FloatArray:
    """Convert points (..., 2) of the letter's frame, y south, to east/north [m]."""
    return np.asarray(points, dtype=float) * [1.0, -1.0]


def errors() -> dict[str, FloatArray]:
    """``D_Error`` of every published reflection point [m], by scenario."""
    slope, intercept = EAST_BUILDING_LINE
    x, y = ROUTE_1_POINTS.T
    return {
        "Route 1": np.abs(y - slope * x - intercept) / np.hypot(1, slope),
        "Route 2": np.abs(ROUTE_2_ORDINATES - ROUTE_2_WALLS),
    }


def table_3() -> list[Entry]:
    """Table 3, printed and recomputed, with the true RMSE in addition."""
    known = {scenario: summary(values) for scenario, values in errors().items()}
    entries = []
    for scenario, column in TABLE_3.items():
        found = known.get(scenario, {})
        for name, statistic in STATISTICS.items():
            label = "standard deviation (printed as RMSE)" if name == "RMSE" else statistic
            entries.append(Entry(scenario, label, column[name], found.get(statistic, np.nan)))
        entries.append(Entry(scenario, "true RMSE", np.nan, found.get("rmse", np.nan)))
    return entries


def as_csv(entries: list[Entry]) -> str:
    """Return the entries as CSV, blank where a number does not exist."""
    rows = [f"{e.scenario},{e.statistic},{_cell(e.printed, 2)},{_cell(e.recomputed, 4)}" for e in entries]
    return "\n".join(["scenario,statistic,printed_m,recomputed_m", *rows]) + "\n"


def points_csv() -> str:
    """Return the published reflection points and their errors as CSV, in the letter's frame and in east/north."""
    by_route = errors()
    rows = [
        f"Route 1,{x:.2f},{y:.2f},{x:.2f},{-y:.2f},{error:.4f}"
        for (x, y), error in zip(ROUTE_1_POINTS, by_route["Route 1"], strict=True)
    ]
    rows += [
        f"Route 2,,{y:.2f},,{-y:.2f},{error:.4f}"
        for y, error in zip(ROUTE_2_ORDINATES, by_route["Route 2"], strict=True)
    ]
    return "\n".join(["scenario,x_m,y_south_m,east_m,north_m,error_m", *rows]) + "\n"


def _cell(value: float, digits: int) -> str:
    """Return the number as text, blank for NaN."""
    return "" if np.isnan(value) else f"{value:.{digits}f}"
