"""Claim: conventions and places that are wrong for a whole campaign are told in 95 % of campaigns, clean ones in 1 %.

Random streets with three to eight receivers in line of sight of one transmitter, which nothing flags; MPCs by image
method with the errors of a scan. Counted is what `sounder.campaign.survey` and `erm reconstruct` would tell. With the
number of campaigns as an argument: ``python benchmarks/conventions.py 40``. A campaign takes a second or two.
"""

from harness import conclude  # isort: skip

import sys
from collections import Counter
from collections.abc import Callable

import numpy as np
import xarray as xr

import erm
from sounder.campaign.survey import remarks_on_table

CAMPAIGNS = 20
TOLD, FALSE = 0.95, 0.01
FREQUENCY = 132e9
STD = {"delay": 3e-11, "azimuth": 0.3, "elevation": 0.5, "path_gain": 1.0}
RANGE, FAN = 30.0, 13.0  # weakest path below the strongest of its position [dB], elevations of the scan [degree]


def campaign(seed: int) -> xr.Dataset:
    """MPC table of a random street."""
    rng = np.random.default_rng([10, seed])
    while True:
        walls = []
        for _ in range(rng.integers(2, 6)):
            middle, turn, half = rng.uniform(-60, 60, 2), rng.uniform(0, np.pi), rng.uniform(5, 25)
            along = half * np.array([np.cos(turn), np.sin(turn)])
            walls.append([(middle - along).tolist(), (middle + along).tolist()])
        street = erm.Environment.walls(walls, top=float(rng.uniform(6, 30)))
        tx, count = np.array([*rng.uniform(-50, 50, 2), rng.uniform(2, 15)]), int(rng.integers(3, 9))
        tables: list[xr.Dataset] = []
        for number in range(200):
            rx = np.array([*rng.uniform(-50, 50, 2), rng.uniform(1.2, 3)])
            distance = np.linalg.norm(tx - rx)
            if distance < 15 or abs(np.degrees(np.arcsin((tx - rx)[2] / distance))) > FAN - 1:
                continue
            one = erm.predict(street, tx, rx, FREQUENCY)
            if not one.sizes["mpc"]:
                continue
            seen = (np.abs(one["elevation"]) < FAN) & (one["path_gain"] > one["path_gain"].max() - RANGE)
            one = one.isel(mpc=np.flatnonzero(seen.values))
            direct = np.abs(one["delay"] - distance / 299792458.0) < 1e-12
            if direct.any():
                tables.append(one.assign(position=("mpc", [f"P{number}"] * one.sizes["mpc"])))
            if len(tables) == count:
                break
        if len(tables) == count:
            break
    table = xr.concat(tables, dim="mpc")
    for name, std in STD.items():
        table[name].values[:] += std * rng.normal(size=table.sizes["mpc"])
        table[f"{name}_std"] = ("mpc", np.full(table.sizes["mpc"], std))
    table["los"] = ("mpc", np.full(table.sizes["mpc"], -1))
    return table


def places(table: xr.Dataset, change: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]) -> xr.Dataset:
    tx, rx = change(table["tx_position"].values, table["rx_position"].values)
    dims = table["tx_position"].dims
    return table.assign(tx_position=(dims, tx), rx_position=(dims, rx))


SWAP = [1, 0, 2]
ROWS: dict[str, Callable[[xr.Dataset], xr.Dataset]] = {
    "clean": lambda t: t,
    "azimuths reversed": lambda t: t.assign(azimuth=(350 - t["azimuth"]) % 360),
    "azimuth zero 10 degrees off": lambda t: t.assign(azimuth=(t["azimuth"] + 10) % 360),
    "elevation sign": lambda t: t.assign(elevation=-t["elevation"]),
    "TX and RX exchanged": lambda t: places(t, lambda tx, rx: (rx, tx)),
    "east and north exchanged": lambda t: places(t, lambda tx, rx: (tx[:, SWAP], rx[:, SWAP])),
    "feet for metres": lambda t: places(t, lambda tx, rx: (tx / 0.3048, rx / 0.3048)),
    "trigger 10 ns late": lambda t: t.assign(delay=t["delay"] + 10e-9),
}


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else CAMPAIGNS
    told: Counter[str] = Counter()
    said: dict[str, Counter[str]] = {name: Counter() for name in ROWS}
    for seed in range(count):
        clean = campaign(seed)
        for name, damage in ROWS.items():
            lines = remarks_on_table(damage(clean))
            told[name] += bool(lines)
            said[name].update(line.split(": ")[1][:60] for line in lines)
    for name in ROWS:
        print(f"{name:32s} {told[name]:4d} of {count}   {dict(said[name].most_common(3))}")
    conclude("told in the worst row", min(told[name] for name in ROWS if name != "clean") / count / TOLD, None)


if __name__ == "__main__":
    main()
