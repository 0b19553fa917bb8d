"""Exact paths off walls, by images, with random errors."""

import numpy as np
from scipy.constants import c

from erm.geometry.vertical import azimuth_of, mirrored
from erm.mpcs.table import make_table
from erm.reconstruction.model.paths import Paths

FREQUENCY = 132e9
TX = np.array([[5.0, 12.0, 28.4], [62.0, 40.0, 20.0]])
WALLS = np.array([[88.0, -2.0], [172.0, -75.0], [271.0, -70.0], [3.0, -3.0]])  # normal [degree], offset [m]


def route(n=12, seed=0):
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(12, 60, n), rng.uniform(8, 50, n), np.full(n, 1.4)])


def bounces(tx, rx, *chain, loss=6.0, height=None):
    """Exact paths off successive walls, as columns of a table."""
    image = tx[:, :2]
    for normal, offset in chain:
        image = mirrored(image, normal, offset)
    seen = image - rx[:, :2]
    height_difference = tx[:, 2] - rx[:, 2] if height is None else height
    length = np.hypot(np.linalg.norm(seen, axis=-1), height_difference)
    gain = 20 * np.log10(c / FREQUENCY / (4 * np.pi * length)) - loss
    return {
        "position": np.array([f"RX{x:.6f}" for x in rx[:, 0]]),
        "tx_position": tx,
        "rx_position": rx,
        "delay": length / c,
        "azimuth": azimuth_of(seen),
        "path_gain": gain,
    }


def scene(walls=WALLS, txs=TX, rxs=None, delay_std=0.0, azimuth_std=0.0, seed=1):
    """Table of the single reflections of every antenna pair off every wall, with random errors."""
    rxs = route() if rxs is None else rxs
    tx, rx = np.repeat(txs, len(rxs), axis=0), np.tile(rxs, (len(txs), 1))
    return joined([bounces(tx, rx, wall) for wall in walls], delay_std, azimuth_std, seed)


def joined(parts, delay_std=0.0, azimuth_std=0.0, seed=1):
    rng = np.random.default_rng(seed)
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    n = len(columns["delay"])
    columns["delay"] = columns["delay"] + delay_std * rng.standard_normal(n)
    columns["azimuth"] = columns["azimuth"] + azimuth_std * rng.standard_normal(n)
    return make_table(columns | {"frequency": FREQUENCY})


def sorted_lines(environment):
    table = environment.reflectors
    lines = np.unique(np.column_stack([table["normal"].values, table["offset"].values]), axis=0)
    return lines[np.argsort(lines[:, 0])]


def paths_of(columns, length_std=0.05, azimuth_std=0.7, loss=6.0):
    n = len(columns["delay"])
    return Paths(
        tx=columns["tx_position"],
        rx=columns["rx_position"],
        length=columns["delay"] * c,
        azimuth=columns["azimuth"],
        length_std=np.full(n, length_std),
        azimuth_std=np.full(n, azimuth_std),
        link=np.arange(n),
        transmitter=np.zeros(n, dtype=np.int64),
        loss=np.full(n, loss),
        loss_std=np.zeros(n),
        wavelength=np.full(n, c / FREQUENCY),
        elevation_excess=np.full(n, np.nan),
        elevation_std=np.full(n, np.nan),
        row=np.arange(n),
        scatter=np.zeros((n, 2)),
        clutter=np.full(n, 0.5 / (60 * 360)),  # none within 60 m
    )
