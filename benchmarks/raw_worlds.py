"""From captures to maps in random rooms and streets: walls found, false length, and their offsets.

Every world has its own walls, transmitter, receivers and instrument (the twin's, with its faults); weak paths stand
about the specular ones, as scattering makes them. Captures are processed and mapped with the defaults of the command
line. A wall counts if paths of three receivers bounced off it once, within 25 dB of the strongest of their position;
it is found if the map has a wall within 0.1 m and 1.5 degrees of most places where they hit. Length of the map is
false if it is over 0.25 m from every wall.

    python benchmarks/raw_worlds.py [worlds] [first seed] [--receivers 10] [--keep FOLDER]
"""

import pools  # isort: skip  # noqa: F401

import argparse
import json
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import shapely
import xarray as xr
from damage import scattered
from survey import room, street

import erm
from erm.common.storage import provenance, write_product
from erm.reconstruction.make_map import make_map
from sounder import Options, calibrate, load_sounder, shipped
from sounder.processing.position import process_recording
from sounder.twin.faults import Faults
from sounder.twin.receiver import back_to_back, record

SOUNDER = load_sounder(shipped.calibration("sounder-132ghz.toml"))
SHOWN = 25.0  # dB
FULL_SCALE = -18.0, -42.0  # dBm; in a room the receiver has an attenuator
NEAR, ALIKE, COVERED = 0.1, 1.5, 0.25
Floats = npt.NDArray[np.float64]


def turned(environment: erm.Environment, points: Floats, angle: float) -> tuple[erm.Environment, Floats]:
    """The same world, turned about the origin."""
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    walls = environment.reflectors
    ends = walls["end_points"].values @ turn.T
    moved = erm.Environment.walls(ends, top=walls["top"].values, ground=environment.ground)
    return moved, np.column_stack([points[:, :2] @ turn.T, points[:, 2]])


class World(NamedTuple):
    """Walls, and where paths of each receiver bounced off them once."""

    environment: erm.Environment
    hits: Floats
    """Rows of wall, receiver, east, north."""


def laid_out(seed: int, receivers: int) -> tuple[erm.Environment, Floats, Faults]:
    """A room or a street, the places of its transmitter and receivers, and its instrument."""
    rng = np.random.default_rng([21, seed])
    environment, tx, places = (room, street)[seed % 2](rng)
    environment, points = turned(environment, np.vstack([tx, places[:receivers]]), rng.uniform(0, 2 * np.pi))
    converter = {"full_scale": FULL_SCALE[seed % 2]}
    return environment, points, Faults(system_response={"seed": int(rng.integers(1e6))}, converter=converter)


def strong_hits(paths: xr.Dataset, receiver: int) -> list[list[float]]:
    """Rows of wall, receiver, east, north: where strong paths bounced off walls once."""
    gain, wall = paths["path_gain"].values, paths["reflector"].values[:, 0]
    strong = (paths["order"].values == 1) & (wall >= 0) & (gain > gain.max() - SHOWN)
    return [[wall[p], receiver, *paths["vertices"].values[p, 0, :2]] for p in np.flatnonzero(strong)]


def measure(seed: int, receivers: int, folder: Path) -> World:
    """Draw a world and write the products of its captures, unless they are there."""
    environment, points, faults = laid_out(seed, receivers)
    b2b, filter_, hits = back_to_back(SOUNDER, 60.0, faults=faults, seed=seed), None, []
    for number, rx in enumerate(points[1:]):
        paths = erm.trace(environment, points[0], rx, SOUNDER.carrier.frequency, max_order=3)
        if not paths.sizes["path"]:
            continue
        hits += strong_hits(paths, number)
        product = folder / f"{seed}" / f"RX{number}.h5"
        if product.exists():
            continue
        ends = {"tx_position": points[0], "rx_position": rx}
        paths = scattered(paths, np.random.default_rng([22, seed, number]))
        made = record(paths, SOUNDER, name=f"RX{number}", snapshots=4, faults=faults, seed=seed, **ends)
        filter_ = filter_ or calibrate(b2b, made)
        groups, _ = process_recording(made, filter_, Options(), threads=1)
        store(groups, product)
    return World(environment, np.array(hits).reshape(-1, 4))


def store(groups: dict[str, xr.Dataset], product: Path) -> None:
    """Write a product."""
    groups["/"].attrs.update(provenance("Channel sounding product", "benchmarks"))
    product.parent.mkdir(parents=True, exist_ok=True)
    write_product(groups, product)


def compare(made: World, found: erm.Environment) -> dict[str, Any]:
    """Walls that could be found, those that were, their offsets [m], and the length of the map, false and all [m]."""
    truth = made.environment.reflectors["end_points"].values
    walls = found.reflectors.isel(reflector=found.reflectors["kind"].values == "wall")["end_points"].values
    lines = shapely.linestrings(walls)
    missed, offsets, asked = [], [], 0
    for index in np.unique(made.hits[:, 0]).astype(int):
        rows = made.hits[made.hits[:, 0] == index]
        if np.unique(rows[:, 1]).size < 3:
            continue
        asked += 1
        along = truth[index, 1] - truth[index, 0]
        n = np.array([-along[1], along[0]]) / np.hypot(*along)
        nearest = np.full(len(rows), np.inf)  # of each hit
        for ends in walls:
            own = ends[1] - ends[0]
            m = np.array([-own[1], own[0]]) / np.hypot(*own)
            reach = (rows[:, 2:] - ends[0]) @ own / (own @ own)
            off = np.abs((rows[:, 2:] - ends[0]) @ m)
            fits = (abs(n @ m) > np.cos(np.deg2rad(ALIKE))) & (reach > -0.5) & (reach < 1.5)
            nearest[fits] = np.minimum(nearest, off)[fits]
        if np.median(nearest) < NEAR:
            offsets.append(float(np.median(nearest)))
        else:
            missed.append(index)
    faces = shapely.unary_union(list(shapely.linestrings(truth))).buffer(COVERED)
    length = float(shapely.length(lines).sum())
    false = float(sum(shapely.length(shapely.difference(line, faces)) for line in lines))
    return {"asked": asked, "missed": missed, "offsets": offsets, "length": length, "false": false}


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("worlds", type=int, nargs="?", default=10)
    parser.add_argument("seed", type=int, nargs="?", default=0)
    parser.add_argument("--receivers", type=int, default=10)
    parser.add_argument("--keep", type=Path)
    options = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as scratch:
        folder = options.keep or Path(scratch)
        for seed in range(options.seed, options.seed + options.worlds):
            start = time.process_time()
            made = measure(seed, options.receivers, folder)
            measured = time.process_time()
            table, _ = erm.read_mpcs(sorted((folder / f"{seed}").glob("*.h5")))
            found, _ = make_map(table, history="raw_worlds.py")
            rows.append(one := compare(made, found))
            print(
                f"{seed:3d} {('room', 'street')[seed % 2]:6s} {table.sizes['mpc']:4d} MPCs, walls "
                f"{one['asked'] - len(one['missed'])} of {one['asked']} (missed {one['missed']}), offset at most "
                f"{1e3 * max(one['offsets'], default=0):.1f} mm, false {one['false']:.1f} of {one['length']:.0f} m; "
                f"{measured - start:.0f} + {time.process_time() - measured:.1f} s",
                flush=True,
            )
    asked, missed = sum(row["asked"] for row in rows), sum(len(row["missed"]) for row in rows)
    offsets = np.array([offset for row in rows for offset in row["offsets"]])
    false, length = sum(row["false"] for row in rows), sum(row["length"] for row in rows)
    print(f"offset RMSE {1e3 * np.sqrt(np.mean(offsets**2)):.1f} mm, median {1e3 * np.median(offsets):.1f} mm")
    print(f"false length {false:.1f} of {length:.1f} m")
    claim = "walls of random places found from captures (at least 0.95 is claimed)"
    print(json.dumps({"claim": claim, "ratio": round(1 - missed / asked, 3), "floor_ratio": round(false / length, 4)}))


if __name__ == "__main__":
    main()
