"""A small scene, and what the tests of the command line do with commands and files."""

import hashlib
import sys
from pathlib import Path

import pytest
import xarray as xr

from sounder import cli

SOUNDER = """
name = "small sounder"
[waveform]
order = 7
polynomial = [7, 1, 0]
chip_rate = 600e6
samples_per_chip = 2
sample_rate = 1.2e9
[carrier]
frequency = 132e9
lo_frequency = 21e9
multiplier = 6
if_frequency = 6e9
[tx_antenna]
gain = 20
pattern = "flat"
[rx_antenna]
gain = 15
hpbw_azimuth = 30
hpbw_elevation = 30
[scan]
azimuth = [0, 30, 60, 90, 120, 150, 180, 210, 240, 270, 300, 330]
elevation = [-15, 15]
[transmitter]
power = 10
[clock]
step = 1e-12
"""
SCENE = """
name = "room"
sounder = "sounder.toml"
attenuator = 60.0
snapshots = 2
max_order = 1
[transmitters]
TX = [4, 5, 3]
[[receivers]]
name = "RX1"
tx = "TX"
position = [12, 3, 1.5]
[[receivers]]
name = "RX2"
tx = "TX"
position = [14, 6, 1.5]
[[environment.walls]]
points = [[0, 0], [20, 0], [20, 10], [0, 10]]
closed = true
material = "metal"
"""
GRID = '[grid]\nazimuth = { dataset = "azimuth" }\nelevation = { dataset = "elevation" }\n'
LAYOUT = f"""
scale_factor = {{ attribute = "scale_factor", of = "iq" }}
agc_gain = {{ dataset = "agc_gain" }}
[captures]
dataset = "iq"
axes = ["position", "azimuth", "elevation", "snapshot", "sample", "iq"]
{GRID}
[positions]
tx = {{ dataset = "tx_position" }}
rx = {{ dataset = "rx_position" }}
name = "P{{}}"
[back_to_back]
dataset = "b2b"
axes = ["snapshot", "sample", "iq"]
attenuation = 60
scale_factor = {{ attribute = "scale_factor", of = "b2b" }}
"""


def run(*arguments: object) -> int:
    """Run the command in this process as a shell would."""
    old, sys.argv = sys.argv, ["sounder", *map(str, arguments)]
    try:
        with pytest.raises(SystemExit) as stop:
            cli.main()
    finally:
        sys.argv = old
    return int(stop.value.code or 0)


def digest(folder: Path) -> dict[str, str]:
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir()) if folder.exists() else []


def group(path: Path, name: str) -> xr.Dataset:
    with xr.open_dataset(path, group=name, engine="h5netcdf") as dataset:
        return dataset.load()


def facts(capsys) -> dict[str, str]:
    return dict(line.split("\t", 1) for line in capsys.readouterr().out.splitlines())
