"""Maps grow in proportion to their MPCs: a city of 484 walls, 30 % of the components from nowhere.

Prints time, memory and what was found for growing numbers of MPCs; the last line compares the largest with the one
before it. Without an argument up to 30 000 MPCs, with a number up to that many: `map_scale.py 1000000`. Of the walls
those are asked for that three paths or more bounced off.
"""

import pools  # isort: skip  # noqa: F401

import json
import resource
import sys
import time

import numpy as np
import numpy.typing as npt
import shapely
from machine import USUAL, loop_time
from scipy.constants import c

from erm.evaluation.outline import evaluate_walls
from erm.geometry.vertical import azimuth_of, mirrored
from erm.mpcs.selection import select
from erm.mpcs.table import make_table
from erm.reconstruction.reconstruct import reconstruct

FREQUENCY = 132e9
DELAY_STD, AZIMUTH_STD, ELEVATION_STD = 1e-10, 0.5, 0.5
STREET, PITCH, BLOCKS = 9.0, 60.0, 11
REACH = 150.0  # m; receivers lie this near to their transmitter
Floats = npt.NDArray[np.float64]


def city(rng: np.random.Generator) -> Floats:
    """Walls (wall, end, xy) of 121 buildings, each turned and sized a little differently."""
    walls = []
    for east in range(BLOCKS):
        for north in range(BLOCKS):
            half = rng.uniform(13, PITCH / 2 - STREET, 2)
            turn = np.deg2rad(rng.uniform(-6, 6))
            corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
            corners = corners @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
            corners += np.array([east, north]) * PITCH
            walls += [np.stack([a, b]) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    return np.array(walls)


def places(buildings: shapely.Geometry, count: int, near: Floats, reach: float, rng: np.random.Generator) -> Floats:
    """Points (count, 2) in the streets, within a reach of a point."""
    found = np.empty((0, 2))
    while len(found) < count:
        tried = near + rng.uniform(-reach, reach, (2 * count, 2))
        found = np.vstack([found, tried[~shapely.contains_xy(buildings, tried)]])
    return found[:count]


Ints = npt.NDArray[np.int64]


def bounces(tx: Floats, rx: Floats, walls: Floats, standing: shapely.Geometry) -> tuple[Ints, Floats, Ints]:
    """Receiver, image (path, 2) and wall of every single bounce that nothing hides."""
    normal = azimuth_of(np.stack([walls[:, 1, 1] - walls[:, 0, 1], walls[:, 0, 0] - walls[:, 1, 0]], axis=-1))
    n = np.stack([np.cos(np.deg2rad(normal)), np.sin(np.deg2rad(normal))], axis=-1)  # outward
    offset = np.sum(n * walls[:, 0], axis=-1)
    depth_tx, depth_rx = tx @ n.T - offset, rx @ n.T - offset
    receiver, wall = np.nonzero((depth_tx > 0.5) & (depth_rx > 0.5))
    image = mirrored(np.broadcast_to(tx, (len(wall), 2)), normal[wall], offset[wall])
    share = depth_rx[receiver, wall] / (depth_tx[wall] + depth_rx[receiver, wall])
    point = rx[receiver] + share[:, None] * (image - rx[receiver])
    along = walls[wall, 1] - walls[wall, 0]
    place = np.sum((point - walls[wall, 0]) * along, axis=-1) / np.sum(along**2, axis=-1)
    on = (place > 0.02) & (place < 0.98)
    receiver, image, point, wall = receiver[on], image[on], point[on], wall[on]
    for from_tx in (True, False):
        end = np.broadcast_to(tx, point.shape) if from_tx else rx[receiver]
        seen = ~shapely.intersects(standing, shapely.linestrings(np.stack([end, point + 1e-6 * (end - point)], axis=1)))
        receiver, image, point, wall = receiver[seen], image[seen], point[seen], wall[seen]
    return receiver, image, wall


def campaign(count: int, seed: int = 1):
    """Walls, how many paths hit each, and a table of about ``count`` MPCs of which 30 % are anything."""
    rng = np.random.default_rng(seed)
    walls = city(rng)
    standing = shapely.multilinestrings(shapely.linestrings(walls))
    shapely.prepare(standing)
    buildings = shapely.union_all(shapely.polygons(walls[:, 0].reshape(-1, 4, 2))).buffer(1.0)
    shapely.prepare(buildings)
    middle = np.full(2, (BLOCKS - 1) / 2 * PITCH)
    transmitters = places(buildings, 60, middle, 0.8 * middle[0], rng)
    parts: dict[str, list[Floats]] = {name: [] for name in ("tx", "rx", "length", "azimuth", "wall")}
    total, wanted = 0, int(0.7 * count)
    while total < wanted:
        for tx in transmitters:
            rx = places(buildings, max(8, count // 2000), tx, REACH, rng)
            receiver, image, wall = bounces(tx, rx, walls, standing)
            seen = image - rx[receiver]
            parts["tx"].append(np.broadcast_to([*tx, 10.0], (len(seen), 3)))
            parts["rx"].append(np.column_stack([rx[receiver], np.full(len(seen), 1.5)]))
            parts["length"].append(np.hypot(np.hypot(*seen.T), 8.5))
            parts["azimuth"].append(azimuth_of(seen))
            parts["wall"].append(wall)
            total += len(seen)
    columns = {name: np.concatenate(part)[:wanted] for name, part in parts.items()}
    wrong = rng.integers(0, wanted, count - wanted)
    direct = np.linalg.norm(columns["tx"][wrong] - columns["rx"][wrong], axis=-1)
    tx, rx = (np.vstack([columns[name], columns[name][wrong]]) for name in ("tx", "rx"))
    length = np.r_[columns["length"], direct + rng.uniform(1, 200, len(wrong))]
    azimuth = np.r_[columns["azimuth"], rng.uniform(0, 360, len(wrong))]
    n = len(length)
    loss = np.r_[np.full(wanted, 8.0), rng.uniform(5, 20, len(wrong))]
    table = make_table(
        {
            "position": "RX",
            "tx_position": tx,
            "rx_position": rx,
            "frequency": FREQUENCY,
            "delay": length / c + DELAY_STD * rng.standard_normal(n),
            "azimuth": azimuth + AZIMUTH_STD * rng.standard_normal(n),
            "elevation": np.rad2deg(np.arcsin(8.5 / length)) + ELEVATION_STD * rng.standard_normal(n),
            "path_gain": 20 * np.log10(c / FREQUENCY / (4 * np.pi * length)) - loss,
            "delay_std": np.full(n, DELAY_STD),
            "azimuth_std": np.full(n, AZIMUTH_STD),
            "elevation_std": np.full(n, ELEVATION_STD),
        }
    )
    return walls, np.bincount(columns["wall"], minlength=len(walls)), table


def main() -> None:
    print(f"ten million steps of a Python loop: {loop_time():.2f} s ({USUAL} s on a usual machine)")
    sizes = [3_000, 10_000, 30_000]
    if sys.argv[1:]:
        sizes += [size for size in (100_000, 300_000, 1_000_000) if size <= int(sys.argv[1])]
    names = ("MPCs", "s", "elapsed", "us an MPC", "GiB", "hit", "found", "correct", "offset RMSE [m]", "median")
    print(" ".join(f"{name:>9s}" for name in names))
    spent = []  # processor seconds: other work on the machine does not count
    for size in sizes:
        walls, hits, table = campaign(size)
        start, before = time.process_time(), time.perf_counter()
        environment, _ = reconstruct(select(table))
        spent.append(time.process_time() - start)
        elapsed = time.perf_counter() - before
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
        score = evaluate_walls(environment, walls, hits)
        error = score["offset_error"]
        print(
            f"{size:9d} {spent[-1]:9.2f} {elapsed:9.2f} {spent[-1] / size * 1e6:9.1f} {memory:9.2f} "
            f"{np.count_nonzero(hits >= 3):9d} {score['found']:9d} {score['correctness']:9.3f} {error['rmse']:15.4f} "
            f"{error['median']:9.4f}",
            flush=True,
        )
    growth = spent[-1] / spent[-2] / (sizes[-1] / sizes[-2])
    claim = f"time an MPC at {sizes[-1]} over that at {sizes[-2]} MPCs (1 is linear)"
    print(json.dumps({"claim": claim, "ratio": round(growth, 3), "floor_ratio": None}))


if __name__ == "__main__":
    main()
