"""MPCs of a bench's paths, and which of them is which."""

import numpy as np

from sounder.mpc.extract import extract_mpcs

GAUSSIAN = {"pattern": "gaussian", "cut": None, "sidelobe_floor": -30.0}


def mpcs(bench, paths, *, noise=-220.0, seed=0, distance=1.0, threshold="usc", scan=None):
    cir = bench.scan(paths, noise=noise, seed=seed) if scan is None else scan
    return extract_mpcs(cir, bench.filter_, bench.sounder, distance=distance, threshold=threshold)


def turn(a, b):
    return (a - b + 180) % 360 - 180


def near(table, path, late=0.5e-9, wide=3.0):
    """Rows of a table at a path's delay and azimuth."""
    rows = (np.abs(table["delay"] - path[1]) < late) & (np.abs(turn(table["azimuth"], path[2])) < wide)
    return table.isel(mpc=np.flatnonzero(rows))


def strong(table, below=60.0):
    """Rows within ``below`` dB of the strongest."""
    gains = table["path_gain"].values
    return table.isel(mpc=np.flatnonzero(gains > gains.max(initial=-np.inf) - below))
