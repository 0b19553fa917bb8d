"""Measurements that tell of no wall: a legal map, no failure, and a line that says why."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scipy.constants import c

from erm.geometry.vertical import azimuth_of, mirrored, unit
from erm.maps.formats import read_map
from erm.mpcs.files import write_mpcs
from erm.mpcs.table import empty_table, make_table

from .commands import run

TX = np.array([-40.0, 3.0, 12.0])


def table(rx, wall=None):
    """One component a receiver: off a wall (normal, offset), or the direct path."""
    tx = np.tile(TX, (len(rx), 1))
    seen = (tx[:, :2] if wall is None else mirrored(tx, *wall)) - rx[:, :2]
    length = np.hypot(np.linalg.norm(seen, axis=-1), TX[2] - rx[:, 2])
    gain = 20 * np.log10(c / 132e9 / (4 * np.pi * length)) - (0 if wall is None else 6)
    return make_table(
        {"position": np.array([f"RX{i}" for i in range(len(rx))]), "tx_position": tx, "rx_position": rx}
        | {"frequency": 132e9, "delay": length / c, "azimuth": azimuth_of(seen), "path_gain": gain}
    )


def places(count):
    return np.column_stack([np.linspace(-20, 30, count), np.linspace(-2, 4, count), np.full(count, 1.5)])


def scattered():
    """One path a receiver, each off a wall of its own."""
    turned = [90.0 + 31.0 * k for k in range(6)]
    behind = [
        min((np.vstack([TX, places(6)])[:, :2] @ unit(turn)).tolist()) - 5 - 2 * k for k, turn in enumerate(turned)
    ]
    parts = [table(places(6), wall).isel(mpc=[k]) for k, wall in enumerate(zip(turned, behind, strict=True))]
    return xr.concat(parts, dim="mpc")


WALL = (90.0, -9.0)
SHARED = "no wall shared with other positions"
CASES = {
    "no MPCs": (empty_table(), ["no MPCs: nothing was received that could locate a wall"]),
    "one MPC": (
        table(places(1), WALL),
        [f"not on the map: {SHARED} (1)", "1 antenna pair: a wall needs paths of at least 3"],
    ),
    "two positions": (
        table(places(2), WALL),
        [f"not on the map: {SHARED} (2)", "2 antenna pairs: a wall needs paths of at least 3"],
    ),
    "all LoS": (
        table(places(6)),
        [
            "not on the map: direct path (6)",
            "no reflector: 0 of 6 MPCs of 6 antenna pairs may be single reflections",
        ],
    ),
    "a path each from elsewhere": (
        scattered(),
        [
            f"not on the map: {SHARED} (6)",
            "no reflector: 6 of 6 MPCs of 6 antenna pairs may be single reflections, no 3 of them off one wall",
        ],
    ),
    "one position five times": (
        table(np.repeat(places(1), 5, axis=0), WALL),
        [f"not on the map: {SHARED} (5)", "1 antenna pair: a wall needs paths of at least 3"],
    ),
}


@pytest.mark.parametrize("suffix", ["h5", "geojson", "gpkg", "csv"])
@pytest.mark.parametrize("case", CASES)
@pytest.mark.slow
def test_what_tells_of_no_wall_is_a_legal_map_and_a_reason(tmp_path: Path, capsys, case, suffix):
    mpcs, reasons = CASES[case]
    out = tmp_path / f"map.{suffix}"
    write_mpcs(mpcs, tmp_path / "mpcs.csv")
    assert run("reconstruct", tmp_path / "mpcs.csv", "--out", out) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    said = [
        line
        for line in printed.out.splitlines()
        if not line.startswith(("reflector\t", "typical standard errors", "calibration: "))
    ]
    assert said == [f"{out}: 0 walls and 0 poles from 0 of {mpcs.sizes['mpc']} MPCs", *reasons]
    environment = read_map(out)
    assert environment.reflectors.sizes["reflector"] == 0
    assert environment.reflectors.attrs["empty"] == "; ".join(reasons)


@pytest.mark.slow
def test_positions_on_a_line_are_a_wall_and_what_is_left_out_is_told(tmp_path: Path, capsys):
    rx = np.column_stack([np.linspace(-20, 30, 6), np.full(6, 2.0), np.full(6, 1.5)])
    both = [table(rx, WALL), table(rx)]
    for number, part in enumerate(both):
        write_mpcs(part, tmp_path / f"{number}.csv")
    assert run("reconstruct", tmp_path / "0.csv", tmp_path / "1.csv", "--out", tmp_path / "map.csv") == 0
    printed = capsys.readouterr().out
    assert "1 wall and 0 poles from 6 of 12 MPCs\nnot on the map: direct path (6)\n" in printed
