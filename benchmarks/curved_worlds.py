"""Curved faces of random places: how many are found, how exact radii are, and how often plane places get cylinders.

Places are traced with `erm.trace`, whose reflections off cylinders are held against closed forms in the tests and
against an independent script. A place has two to four walls, and unless it is ``--plane`` one to three arcs (radius 1
to 40 m, a third of them concave) and up to four pillars; chains off a cylinder and a plane are among the paths.
``--street`` is a street with a colonnade, a curved facade, a rounded corner and a lamp post. ``--delay-std``,
``--azimuth-std``, ``--strays`` are what a measurement adds, and ``--survey`` what a survey does: positions to 0.15 m,
headings to half a degree and clocks to 0.2 ns each, all azimuths by -4 degrees, all delays by -2.3 ns, all gains by
-12 dB. Each false element is printed with what its MPCs are. With ``--relief`` the walls of a plane place are facades
of piers and panes, recessed by up to 0.35 m and tilted by up to a degree: each is to be one wall on the mean of what it
reflected.

    python benchmarks/curved_worlds.py --places 10 [--plane] [--street] [--relief] [--delay-std 0.1]
        [--azimuth-std 0.6] [--strays 0.3] [--survey]
"""

import argparse
import time
from collections import Counter
from typing import Any

import numpy as np
import xarray as xr

import erm
from erm.maps.arcs import arc_points
from erm.maps.environment import NO_BOUNCE, Slab
from erm.reconstruction.make_map import make_map

FREQUENCY = 60e9
DYNAMIC_RANGE = 30.0  # dB


def place(rng: np.random.Generator, *, curved: bool) -> erm.Environment:
    """A random place within 25 m of the origin."""
    environment = erm.Environment.empty(ground=Slab(0.0))
    ends = []
    for _ in range(rng.integers(2, 5)):
        turn, distance, half = rng.uniform(0, 360), rng.uniform(12, 22), rng.uniform(4, 20)
        n = np.array([np.cos(np.deg2rad(turn)), np.sin(np.deg2rad(turn))])
        along = np.array([-n[1], n[0]])
        middle = distance * n + rng.uniform(-5, 5) * along
        ends.append([middle - half * along, middle + half * along])
    environment = erm.Environment.walls(ends, top=12.0, ground=Slab(0.0))
    if not curved:
        return environment
    for _ in range(rng.integers(1, 4)):
        radius = float(np.exp(rng.uniform(0, np.log(40)))) * (1 if rng.random() < 2 / 3 else -1)
        facing = rng.uniform(0, 360)  # toward the antennas, from the face
        n = np.array([np.cos(np.deg2rad(facing)), np.sin(np.deg2rad(facing))])
        centre = -rng.uniform(6, 18) * n - radius * n
        half = min(np.rad2deg(rng.uniform(2, 10) / abs(radius)), 120)
        middle = facing + (180 if radius < 0 else 0)
        environment = environment.with_arcs([centre], radius, [[middle - half, middle + half]], top=10.0)
    pillars = rng.integers(0, 5)
    for centre in rng.uniform(-9, 9, (pillars, 2)):
        environment = environment.with_poles([centre], float(np.exp(rng.uniform(np.log(0.15), np.log(0.6)))), top=6.0)
    return environment


def street(rng: np.random.Generator) -> erm.Environment:
    """A street of 120 m: a facade behind a colonnade, opposite a curved facade, a rounded corner and a facade."""
    north, south = rng.uniform(8, 14), -rng.uniform(8, 14)
    corner, radius, bent = rng.uniform(5, 20), float(rng.uniform(2, 5)), float(rng.uniform(15, 50))
    ends = [[[70.0, north], [-55.0, north]], [[corner, south], [70.0, south]]]
    place = erm.Environment.walls(ends, top=15.0, ground=Slab(0.0))
    place = place.with_arcs([[corner, south - radius]], radius, [[90.0, 180.0]], top=15.0)
    middle = corner - rng.uniform(20, 40)
    half = min(np.rad2deg(rng.uniform(12, 20) / bent), 80)
    place = place.with_arcs([[middle, south - bent]], bent, [[90 - half, 90 + half]], top=15.0)
    spacing, in_front = rng.uniform(10, 18), rng.uniform(2, 4)
    for number in range(-2, 3):
        place = place.with_poles([[number * spacing, north - in_front]], float(rng.uniform(0.2, 0.5)), top=8.0)
    return place.with_poles([[rng.uniform(20, 50), south + rng.uniform(1, 3)]], 0.08, top=8.0)


def with_relief(environment: erm.Environment, rng: np.random.Generator) -> tuple[erm.Environment, list[int]]:
    """The walls as piers and recessed panes, and the wall of each."""
    ends, of = [], []
    recess = rng.uniform(0.1, 0.35, environment.reflectors.sizes["reflector"])
    for number, (start, end) in enumerate(environment.reflectors.end_points.values):
        length = float(np.linalg.norm(end - start))
        along = (end - start) / length
        behind = -np.array([-along[1], along[0]]) * np.sign(start @ np.array([along[1], -along[0]]))
        place, pane = 0.0, False
        while place < length:
            step = rng.uniform(0.8, 2.5)
            turn = np.deg2rad(rng.uniform(-1, 1)) * pane
            depth = pane * recess[number] * rng.uniform(0.7, 1.3) + np.array([-1, 1])[:, None] * turn * step / 2
            edges = start + along * np.array([[place], [min(place + step, length)]]) - behind * depth
            ends.append(edges)
            of.append(number)
            place, pane = place + step, not pane
    return erm.Environment.walls(ends, top=12.0, ground=Slab(0.0)), of


def measured(
    environment: erm.Environment, rng: np.random.Generator, options: argparse.Namespace
) -> tuple[Any, list, list[str]]:
    """An MPC table of the place, the true reflection points (reflector, position, point), and what each MPC met."""
    tx = np.array([*rng.uniform(-8, 8, 2), rng.uniform(2, 6)])
    if options.street:
        tx = np.array([-45.0, rng.uniform(-3, 3), 9.0])
    rows: dict[str, list] = {name: [] for name in ("position", "rx", "delay", "azimuth", "gain")}
    hits, met = [], []
    names = dict(enumerate(f"{kind} {row}" for row, kind in enumerate(environment.reflectors.kind.values.tolist())))
    names |= {-1: "ground", -2: "ceiling"}
    survey = np.array([0.15, 0.15, 0.5, 0.2e-9]) * options.survey
    common = np.array([-4.0, -2.3e-9]) * options.survey
    count = rng.integers(20, 45)
    for number in range(count):
        rx = np.array([*rng.uniform(-11, 11, 2), 1.5])
        if options.street:
            rx = np.array([-35 + 95 * (number + rng.random()) / count, rng.uniform(-5, 5), 1.5])
        order = 1 if options.relief else 2
        paths = erm.trace(environment, tx, rx, FREQUENCY, max_order=order, max_cylinder_order=order)
        if not paths.sizes["path"]:
            continue
        gain = paths.path_gain.values - 12.0 * options.survey
        error = survey * rng.standard_normal(4)
        error[2:] += common
        surveyed = rx + np.r_[error[:2], 0.0]
        for path in np.flatnonzero(gain > gain.max() - DYNAMIC_RANGE).tolist():
            rows["position"].append(f"P{number:02d}")
            rows["rx"].append(surveyed)
            met.append(" ".join(names[one] for one in paths.reflector.values[path].tolist() if one != NO_BOUNCE))
            rows["delay"].append(paths.delay.values[path] + error[3] + options.delay_std * 1e-9 * rng.standard_normal())
            rows["azimuth"].append(paths.azimuth.values[path] + error[2] + options.azimuth_std * rng.standard_normal())
            rows["gain"].append(gain[path] + rng.normal(0, 1 if options.strays else 0))
            if paths.order.values[path] == 1 and paths.reflector.values[path, 0] >= 0:
                hits.append((int(paths.reflector.values[path, 0]), number, paths.vertices.values[path, 0, :2]))
        for _ in range(rng.poisson(options.strays * len(gain))):
            rows["position"].append(f"P{number:02d}")
            rows["rx"].append(surveyed)
            met.append("stray")
            rows["delay"].append(np.linalg.norm(tx - rx) / 299792458.0 + error[3] + rng.uniform(2e-9, 80e-9))
            rows["azimuth"].append(rng.uniform(0, 360))
            rows["gain"].append(gain.max() - rng.uniform(8, DYNAMIC_RANGE))
    columns = {
        "position": np.array(rows["position"]),
        "tx_position": np.tile(tx, (len(rows["position"]), 1)),
        "rx_position": np.array(rows["rx"]),
        "frequency": FREQUENCY,
        "delay": np.array(rows["delay"]),
        "azimuth": np.array(rows["azimuth"]),
        "path_gain": np.array(rows["gain"]),
    }
    if options.delay_std:
        columns |= {"delay_std": options.delay_std * 1e-9, "azimuth_std": options.azimuth_std}
    return erm.make_table(columns), hits, met


def distances(found: xr.Dataset, points: np.ndarray) -> np.ndarray:
    """Distances (reflector, point) of points from the reflectors of a map [m]."""
    from shapely import LineString
    from shapely import points as shapely_points

    lines = []
    for row in range(found.sizes["reflector"]):
        ends, centre, radius = (found[name].values[row] for name in ("end_points", "centre", "radius"))
        if found.kind.values[row] == "pole":
            ends = centre + radius * np.array([[1.0, 0.0], [1.0, 0.0]])
        lines.append(LineString(ends if found.kind.values[row] == "wall" else arc_points(ends, centre, radius)))
    return np.array([line.distance(shapely_points(points)) for line in lines]).reshape(len(lines), -1)


def facade_errors(found: xr.Dataset, hits: list) -> list[tuple[int, float]]:
    """Of each facade with eight reflections: the number of walls within 0.5 m of two, and the error of the best [m]."""
    errors = []
    for number in {number for number, _ in hits}:
        points = np.array([point for own, point in hits if own == number])
        if len(points) < 8:
            continue
        near = distances(found, points) < 0.5 if found.sizes["reflector"] else np.zeros((0, len(points)))
        walls = np.flatnonzero((near.sum(axis=1) >= 2) & (found.kind.values == "wall"))
        if not len(walls):
            errors.append((0, np.nan))
            continue
        best = walls[np.argmax(near[walls].sum(axis=1))]
        n = np.deg2rad(found.normal.values[best])
        off = points @ np.array([np.cos(n), np.sin(n)]) - found.offset.values[best]
        errors.append((len(walls), abs(float(np.mean(off)))))
    return errors


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--places", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--plane", action="store_true")
    parser.add_argument("--street", action="store_true")
    parser.add_argument("--relief", action="store_true")
    parser.add_argument("--delay-std", type=float, default=0.0)
    parser.add_argument("--azimuth-std", type=float, default=0.0)
    parser.add_argument("--strays", type=float, default=0.0)
    parser.add_argument("--survey", action="store_true")
    parser.add_argument("--tolerance", type=float, default=0.05)
    options = parser.parse_args()
    total = {kind: [0, 0] for kind in ("wall", "arc", "pole")}
    radii, right, length, cylinders, rough, walls, facades = [], 0.0, 0.0, 0, 0, 0, []
    for seed in range(options.seed, options.seed + options.places):
        rng = np.random.default_rng(seed)
        environment = street(rng) if options.street else place(rng, curved=not (options.plane or options.relief))
        facade: list[int] = []
        if options.relief:
            environment, facade = with_relief(environment, rng)
        table, hits, met = measured(environment, rng, options)
        start = time.process_time()
        found, located = make_map(table, history="benchmark") if options.survey else erm.reconstruct(erm.select(table))
        seconds = time.process_time() - start
        kinds = found.reflectors.kind.values
        cylinders += int(np.sum(kinds != "wall"))
        rough += int(np.sum(found.reflectors.relief.values > 0))
        walls += int(np.sum(kinds == "wall"))
        if options.relief:
            facades += facade_errors(found.reflectors, [(facade[reflector], point) for reflector, _, point in hits])
            continue
        line = [f"seed {seed}: {len(table.mpc)} MPCs, {seconds:.1f} s, found {[str(k) for k in kinds]}"]
        for row, kind in enumerate(environment.reflectors.kind.values.tolist()):
            own = [(number, point) for reflector, number, point in hits if reflector == row]
            if len({number for number, _ in own}) < (3 if kind == "wall" else 4):
                continue
            near = distances(found.reflectors, np.array([point for _, point in own])) < options.tolerance
            share = near.mean(axis=1).max(initial=0.0)
            total[kind][1] += 1
            total[kind][0] += int(share >= 0.6)
            best = int(np.argmax(near.mean(axis=1))) if len(near) else -1
            true = float(environment.reflectors.radius.values[row])
            text = f"{kind} r={true:.2f} hits {len(own)} share {share:.2f}"
            if share >= 0.6 and kind != "wall" and kinds[best] != "wall":
                got, std = float(found.reflectors.radius.values[best]), float(found.reflectors.radius_std.values[best])
                radii.append(abs(got - true) < max(0.2 * abs(true), 2 * std))
                text += f" -> {got:.2f} +- {std:.2f}"
            line.append(text)
        for one in range(len(kinds)):
            ends, centre, radius = (found.reflectors[n].values[one] for n in ("end_points", "centre", "radius"))
            if kinds[one] == "pole":
                ends = centre + radius * np.array([[1.0, 0.0], [1.0, 0.0]])
            points = ends if kinds[one] == "wall" else arc_points(ends, centre, radius)
            steps = np.r_[0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=-1))]
            at = np.arange(0, steps[-1], 0.1)
            samples = np.stack([np.interp(at, steps, points[:, axis]) for axis in (0, 1)], axis=-1)
            off = distances(environment.reflectors, samples).min(axis=0)
            right, length = right + 0.1 * np.sum(off < options.tolerance), length + 0.1 * len(at)
            if np.mean(off < options.tolerance) < 0.5:
                made = Counter(np.array(met)[located.wall.values == one].tolist()).most_common(3)
                line.append(f"false {kinds[one]} r={radius:.2f} of {0.1 * len(at):.1f} m: {made}")
        print("\n  ".join(line), flush=True)
    print(f"{rough} of {walls} walls with relief")
    if options.relief:
        elements, offset = np.array(facades).T
        print(f"facades on one wall: {np.sum(elements == 1)} of {len(elements)}, offset of the mean plane [m]:")
        print(np.quantile(offset[elements > 0], [0.5, 0.9, 1.0]).round(3))
        return
    print({kind: f"{a} of {b}" for kind, (a, b) in total.items()}, f"radii right {sum(radii)} of {len(radii)}")
    print(f"correct length {right / max(length, 1e-9):.3f} of {length:.0f} m, {cylinders} cylinders on the maps")


if __name__ == "__main__":
    main()
