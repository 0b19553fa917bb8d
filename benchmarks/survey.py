"""Common errors of heading and clock are found to within their stated errors, in random rooms and streets.

Each world gets random errors of heading, clock and gain that all its paths share; half of the worlds also errors of
each position (0.2 m, 3 degrees, 0.5 ns). MPCs have errors of 0.1 ns and 0.5 degrees. A row tells the RMSE of heading
and clock, the share of errors within one and two stated standard errors (68 and 95 % if these are right), how often the
clock was told to be ambiguous, and the number of false remarks on conventions. An argument is the number of worlds of a
row.
"""

import json
import sys
import time

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy.constants import c

import erm
from erm.maps.environment import Slab
from erm.survey.calibration import calibrate
from erm.survey.conventions import contradictions

FREQUENCY = 132e9
DELAY_STD, ANGLE_STD = 1e-10, 0.5
SHOWN = 30.0  # dB; weaker paths than this under the strongest of a position are not received
Floats = npt.NDArray[np.float64]


def room(rng: np.random.Generator) -> tuple[erm.Environment, Floats, Floats]:
    """An L-shaped room with a floor, a transmitter and 30 receivers."""
    a, b = rng.uniform(5, 9, 2)
    width, depth = a + rng.uniform(4, 12), b + rng.uniform(4, 8)
    corners = np.array([[0, 0], [width, 0], [width, b], [a, b], [a, depth], [0, depth]])
    walls = [[one, other] for one, other in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    places = rng.uniform(0.5, 0.5 + np.array([width, depth]) - 1, (400, 2))
    inside = (places[:, 0] < a - 0.5) | (places[:, 1] < b - 0.5)
    places = places[inside][:31]
    environment = erm.Environment.walls(walls, top=3.5, ground=Slab(0.0))
    return environment, np.r_[places[0], 2.5], np.column_stack([places[1:], np.full(30, 1.5)])


def street(rng: np.random.Generator) -> tuple[erm.Environment, Floats, Floats]:
    """Buildings of different depths on both sides of a street, a transmitter and 24 receivers."""
    walls = []
    for side in (-1, 1):
        east = -80.0
        while east < 80:
            length, line = rng.uniform(12, 40), side * rng.uniform(9, 16)
            turn = rng.normal(0, 0.03) * length
            walls.append([[east, line - turn], [east + length, line + turn]])
            walls.append([[east + length, line + turn], [east + length, side * 30.0]])
            east += length + rng.uniform(0, 6)
    receivers = np.column_stack([rng.uniform(-60, 60, 24), rng.uniform(-7, 7, 24), np.full(24, 1.5)])
    environment = erm.Environment.walls(walls, top=20.0, ground=Slab(0.0))
    return environment, np.array([rng.uniform(-60, 60), rng.uniform(-7, 7), rng.uniform(4, 15)]), receivers


def measured(world: tuple[erm.Environment, Floats, Floats], rng: np.random.Generator, direct: bool) -> xr.Dataset:
    """Paths of a world with errors of MPCs; some direct paths are obstructed by 10 to 23 dB."""
    environment, tx, receivers = world
    links = []
    for number, rx in enumerate(receivers):
        link = erm.predict(environment, tx, rx, FREQUENCY, max_order=2)
        distance = float(np.linalg.norm(tx - rx))
        is_direct = np.abs(link["delay"].values * c - distance) < 1e-6
        gain = link["path_gain"].values - is_direct * (rng.random() < 0.3) * rng.uniform(10, 23)
        twin = np.hypot(np.linalg.norm((tx - rx)[:2]), tx[2] + rx[2])
        kept = np.isfinite(gain) & (gain > gain.max(initial=-np.inf) - SHOWN)
        if not direct:
            kept &= ~is_direct & (np.abs(link["delay"].values * c - twin) > 1e-6)
        link = link.assign(path_gain=("mpc", gain), position=("mpc", [f"RX{number}"] * len(gain)))
        links.append(link.isel(mpc=np.flatnonzero(kept)))
    table = xr.concat(links, dim="mpc")
    n = table.sizes["mpc"]
    return table.assign(
        delay=table["delay"] + DELAY_STD * rng.standard_normal(n),
        azimuth=table["azimuth"] + ANGLE_STD * rng.standard_normal(n),
        elevation=table["elevation"] + ANGLE_STD * rng.standard_normal(n),
        delay_std=("mpc", np.full(n, DELAY_STD)),
        azimuth_std=("mpc", np.full(n, ANGLE_STD)),
        elevation_std=("mpc", np.full(n, ANGLE_STD)),
    )


def with_errors(table: xr.Dataset, rng: np.random.Generator, each: bool) -> tuple[xr.Dataset, float, float]:
    """Survey errors; return the table, and the common errors of heading [degree] and clock [s]."""
    heading, clock, gain = rng.uniform(-10, 10), rng.uniform(-5e-9, 5e-9), rng.uniform(-60, 60)
    _, link = np.unique(table["position"].values, return_inverse=True)
    scale = np.array([0.2, 0.2, 3.0, 0.5e-9]) * each
    own = (rng.standard_normal((link.max() + 1, 4)) * scale)[link]
    moved = table["rx_position"].values + np.column_stack([own[:, :2], np.zeros(len(own))])
    changed = table.assign(
        rx_position=(("mpc", "xyz"), moved),
        azimuth=table["azimuth"] + heading + own[:, 2],
        delay=table["delay"] + clock + own[:, 3],
        path_gain=table["path_gain"] + gain,
    )
    return changed, heading, clock


def main() -> None:
    count = int(sys.argv[1]) if sys.argv[1:] else 20
    print(
        "world  direct each | RMSE heading [degree] clock [ns] | within 1, 2 std: heading; clock | ambiguous remarks s"
    )
    pooled = []
    for make in (room, street):
        for direct in (True, False):
            for each in (False, True):
                rows, unknown, remarks, spent = [], 0, 0, 0.0
                for seed in range(count):
                    rng = np.random.default_rng([seed, direct, each])
                    table, heading, clock = with_errors(measured(make(rng), rng, direct), rng, each)
                    start = time.process_time()
                    found = calibrate(table)
                    spent += time.process_time() - start
                    remarks += bool(contradictions(table))
                    unknown += "clock" in found.ambiguous
                    error = np.array([found.heading - heading, found.clock - clock])
                    rows.append([*error, *np.abs(error) / [found.std("heading"), found.std("clock")]])
                values = np.array(rows)
                rmse = np.sqrt(np.mean(values[:, :2] ** 2, axis=0)) * [1, 1e9]
                share = [np.mean(values[:, 2:] < sigmas, axis=0) for sigmas in (1, 2)]
                pooled.append(values[:, 2:])
                print(
                    f"{make.__name__:6s} {direct!s:6s} {each!s:5s} {rmse[0]:8.3f} {rmse[1]:8.3f}   "
                    f"{share[0][0]:5.2f} {share[1][0]:5.2f}  {share[0][1]:5.2f} {share[1][1]:5.2f}  "
                    f"{unknown:4d} {remarks:4d} {spent / count:6.2f}",
                    flush=True,
                )
    everything = np.concatenate(pooled)
    claim = "share of errors of heading and clock within two standard errors (0.95 if these are right)"
    print(json.dumps({"claim": claim, "ratio": round(float(np.mean(everything < 2)), 3), "floor_ratio": None}))


if __name__ == "__main__":
    main()
