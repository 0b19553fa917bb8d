"""Maps of random rooms and streets from surveys with errors: walls found, false lengths, and whether errors are stated.

Worlds and errors are those of `survey.py`. Each row of the output is a world: the walls that at least three positions
received once reflected, those found within half a metre, the length of the map that is more than a quarter of a metre
from any wall, the errors of the found walls in their stated standard errors, that of the common clock, and the warnings
of the map. Errors of the survey: ``nodirect`` has no direct path, ``clock`` neither that nor an error of the heading,
``each`` has errors of each position, ``rx`` only those of receivers of half a metre.
"""

import argparse
import json
import time

import numpy as np
import numpy.typing as npt
import shapely
import xarray as xr
from survey import FREQUENCY, measured, room, street, with_errors

import erm
from erm.reconstruction.make_map import make_map
from erm.survey.report import warnings

COVERED, NEAR, ALIKE = 0.25, 0.5, 3.0  # m, m, degree
Floats = npt.NDArray[np.float64]


def drawn(kind: str, row: str, seed: int) -> tuple[erm.Environment, Floats, xr.Dataset, float, float]:
    """A world, its antennas, its table, and the common errors of heading [degree] and clock [s]."""
    rng = np.random.default_rng([31, seed])
    environment, tx, receivers = (room if kind == "room" else street)(rng)
    table = measured((environment, tx, receivers), rng, row not in ("nodirect", "clock"))
    if row == "rx":
        _, link = np.unique(table["position"].values, return_inverse=True)
        moved = table["rx_position"].values.copy()
        moved[:, :2] += 0.5 * rng.standard_normal((link.max() + 1, 2))[link]
        return environment, np.vstack([tx, receivers]), table.assign(rx_position=(("mpc", "xyz"), moved)), 0.0, 0.0
    table, heading, clock = with_errors(table, rng, row == "each")
    if row == "clock":
        table, heading = table.assign(azimuth=table["azimuth"] - heading), 0.0
    return environment, np.vstack([tx, receivers]), table, heading, clock


def asked(environment: erm.Environment, points: Floats) -> dict[int, Floats]:
    """Middle (2,) of the reflection points of each wall that three positions see."""
    hits: dict[int, list[Floats]] = {}
    for rx in points[1:]:
        paths = erm.trace(environment, points[0], rx, FREQUENCY, max_order=1)
        for p in np.flatnonzero((paths["order"].values == 1) & (paths["reflector"].values[:, 0] >= 0)):
            if environment.reflectors["kind"].values[paths["reflector"].values[p, 0]] == "wall":
                hits.setdefault(int(paths["reflector"].values[p, 0]), []).append(paths["vertices"].values[p, 0, :2])
    return {wall: np.median(places, axis=0) for wall, places in hits.items() if len(places) >= 3}


def compare(truth: erm.Environment, middles: dict[int, Floats], found: erm.Environment) -> dict[str, list[float]]:
    """Errors of walls [m] and in standard errors; false and whole length [m]."""
    ends = truth.reflectors["end_points"].values
    walls = found.reflectors.isel(reflector=found.reflectors["kind"].values == "wall")
    offsets, sigmas = [], []
    for index, middle in middles.items():
        along = ends[index, 1] - ends[index, 0]
        n = np.array([-along[1], along[0]])[:2] / np.hypot(*along[:2])
        best = None
        for k in range(walls.sizes["reflector"]):
            normal = np.deg2rad(float(walls["normal"][k]))
            m = np.array([np.cos(normal), np.sin(normal)])
            own = walls["end_points"].values[k][:, :2]
            reach = (middle - own[0]) @ (own[1] - own[0]) / np.sum((own[1] - own[0]) ** 2)
            away = float(walls["offset"][k]) - m @ middle
            if abs(n @ m) < np.cos(np.deg2rad(ALIKE)) or not -0.5 < reach < 1.5 or abs(away) > NEAR:
                continue
            slope = np.array([-np.deg2rad(1) * np.array([-m[1], m[0]]) @ middle, 1.0])
            std = float(np.sqrt(slope @ walls["covariance"].values[k] @ slope))
            if best is None or abs(away) < best[0]:
                best = abs(away), abs(away) / std
        if best:
            offsets.append(best[0])
            sigmas.append(best[1])
    lines = shapely.linestrings(walls["end_points"].values[:, :, :2])
    faces = shapely.unary_union(list(shapely.linestrings(ends[truth.reflectors["kind"].values == "wall"]))).buffer(
        COVERED
    )
    false = float(sum(shapely.length(shapely.difference(line, faces)) for line in lines))
    return {"offsets": offsets, "sigmas": sigmas, "length": [false, float(shapely.length(lines).sum())]}


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("worlds", type=int, nargs="?", default=10)
    parser.add_argument("seed", type=int, nargs="?", default=0)
    parser.add_argument("--row", choices=("nodirect", "clock", "each", "rx"), default="nodirect")
    parser.add_argument("--kind", choices=("room", "street"), default="street")
    options = parser.parse_args()
    wanted, offsets, sigmas, false, length = 0, [], [], 0.0, 0.0
    for seed in range(options.seed, options.seed + options.worlds):
        environment, points, table, _, clock = drawn(options.kind, options.row, seed)
        middles = asked(environment, points)
        start = time.process_time()
        found, _ = make_map(table, history="survey_worlds.py")
        spent = time.process_time() - start
        one = compare(environment, middles, found)
        attributes = found.reflectors.attrs
        wanted += len(middles)
        offsets += one["offsets"]
        sigmas += one["sigmas"]
        false, length = false + one["length"][0], length + one["length"][1]
        print(
            f"{seed:3d} {table.sizes['mpc']:4d} MPCs, walls {len(one['offsets'])} of {len(middles)}, false "
            f"{one['length'][0]:.1f} of {one['length'][1]:.0f} m, offsets {np.round(one['offsets'], 3).tolist()} m, "
            f"{np.round(one['sigmas'], 1).tolist()} sigma, clock {(attributes['clock'] - clock) * 1e9:.2f} ± "
            f"{attributes['clock_std'] * 1e9:.2f} ns, unknown: {attributes['ambiguous']}, {spent:.1f} s",
            *warnings(found),
            sep="\n    ",
            flush=True,
        )
    share = [round(float(np.mean(np.array(sigmas) < k)), 3) for k in (1, 2)]
    print(f"offset RMSE {np.sqrt(np.mean(np.square(offsets))):.3f} m, within one and two standard errors {share}")
    claim = "walls of random surveys found within half a metre; false share of the map"
    print(
        json.dumps({"claim": claim, "ratio": round(len(offsets) / wanted, 3), "floor_ratio": round(false / length, 4)})
    )


if __name__ == "__main__":
    main()
