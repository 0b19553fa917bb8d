"""Claim: maps of damaged recordings are at most 1.2 times as far off as clean ones, and at most 1 % of them is false.

The damage of `benchmarks/damage.py` in every position of random rooms and streets, ten receivers each, one direction in
ten, at random or the strongest ones: what is told, MPCs, and maps. What was measured is kept, a line a row and world,
and not measured again.

    python benchmarks/damage_maps.py RESULTS.jsonl [--worlds 10] [--seed 0] [parts of names of rows...]
"""

import pools  # isort: skip  # noqa: F401

import argparse
import json
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from damage import OF_DIRECTIONS, OF_POSITIONS, Draw, Row, directions
from harness import conclude
from raw_worlds import SOUNDER, World, compare, laid_out, store, strong_hits

import erm
from erm.common.errors import DataError
from erm.reconstruction.make_map import make_map
from sounder import calibrate
from sounder.twin.receiver import back_to_back, record

RECEIVERS = 10
ROWS = ["clean", *(f"{name}{end}" for name in OF_DIRECTIONS for end in ("", ", strongest")), *OF_POSITIONS]


def campaign(seed: int) -> tuple[World, list[Draw]]:
    """Clean captures of all receivers of a world."""
    environment, points, faults = laid_out(seed, RECEIVERS)
    b2b, filter_, hits, made = back_to_back(SOUNDER, 60.0, faults=faults, seed=seed), None, [], []
    for number, rx in enumerate(points[1:]):
        paths = erm.trace(environment, points[0], rx, SOUNDER.carrier.frequency, max_order=3)
        if paths.sizes["path"]:
            hits += strong_hits(paths, number)
            ends = {"tx_position": points[0], "rx_position": rx}
            one = record(paths, SOUNDER, name=f"RX{number}", snapshots=4, faults=faults, seed=seed, **ends)
            filter_ = filter_ or calibrate(b2b, one)
            made.append(Draw.of(one, filter_, paths))
    return World(environment, np.array(hits).reshape(-1, 4)), made


def measured(name: str, world: World, made: list[Draw]) -> dict[str, Any]:
    """Counts of a row in a world, and its map."""
    row, short = Row(), name.removesuffix(", strongest")
    damage = (OF_DIRECTIONS | OF_POSITIONS).get(short)
    with tempfile.TemporaryDirectory() as folder:
        for number, one in enumerate(made):
            rng = np.random.default_rng([9, number])
            where = directions(one, rng, strongest=name != short) if short in OF_DIRECTIONS else []
            recording = damage(one, rng, where) if damage else one.with_captures(one.captures)
            try:
                groups = row.add(one, recording, None if short in OF_POSITIONS else where)
            except DataError:  # refused: told
                row.known, row.told = row.known + len(where), row.told + len(where)
                continue
            store(groups, Path(folder) / f"RX{number}.h5")
        try:
            table, _ = erm.read_mpcs(sorted(Path(folder).glob("*.h5")))
            found = compare(world, make_map(table, history="damage_maps.py")[0])
        except DataError:
            found = {"asked": 0, "missed": [], "offsets": [], "length": 0.0, "false": 0.0}
    return vars(row) | {"row": name} | {f"map_{key}": value for key, value in found.items()}


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("results", type=Path)
    parser.add_argument("rows", nargs="*", default=[""])
    parser.add_argument("--worlds", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    results, seeds = options.results, range(options.seed, options.seed + options.worlds)
    wanted = ["clean", *(name for name in ROWS[1:] if any(part in name for part in options.rows))]
    have = [json.loads(line) for line in results.read_text().splitlines()] if results.exists() else []
    for seed in seeds:
        missing = [name for name in wanted if not any(one["row"] == name and one["seed"] == seed for one in have)]
        world, made = campaign(seed) if missing else (None, [])
        for name in missing:
            start = time.process_time()
            have.append(measured(name, world, made) | {"seed": seed, "cpu": time.process_time() - start})
            with results.open("a") as file:
                file.write(json.dumps(have[-1], default=float) + "\n")
    print(
        f"{'damage':40s} told of known falsely  false of MPCs found of paths  walls of    off mm  false of m    CPU s"
    )
    ratios = []
    for name in wanted:
        rows = [one for one in have if one["row"] == name and one["seed"] in seeds]
        n = {key: sum(one[key] for one in rows) for key in rows[0] if key not in ("row", "map_missed", "map_offsets")}
        offsets = np.array([offset for one in rows for offset in one["map_offsets"]])
        rms = 1e3 * np.sqrt(np.mean(offsets**2)) if offsets.size else np.nan
        print(
            f"{name:40s} {n['told']:4d} {n['known']:5d} {n['falsely']:7d} {n['false']:6d} {n['mpcs']:7d}"
            f" {n['found']:6d} {n['paths']:5d} {offsets.size:6d} {n['map_asked']:3d} {rms:8.1f}"
            f" {n['map_false']:6.1f} {n['map_length']:5.0f} {n['cpu']:8.1f}"
        )
        ratios.append(n["map_false"] / max(n["map_length"], 1.0))
    conclude("false share of the map in the worst row (at most 0.01 is claimed)", max(ratios), None)


if __name__ == "__main__":
    main()
