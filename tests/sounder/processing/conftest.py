"""Campaigns of many small positions."""

from collections.abc import Callable
from pathlib import Path

import pytest
import xarray as xr

from sounder.recordings.writer import write_back_to_back, write_recording
from sounder.twin import receiver

WAVEFORM = {"order": 7, "polynomial": [7, 1, 0], "chip_rate": 6e8, "samples_per_chip": 2, "sample_rate": 1.2e9}
HORN = {"pattern": "gaussian", "cut": None, "hpbw_azimuth": 60.0, "hpbw_elevation": 60.0}


@pytest.fixture(scope="session")
def campaign_maker(description, tmp_path_factory) -> Callable[..., list[Path]]:
    """Make recordings P0, P1, ... of one path each, and their back-to-back, which comes last."""

    def make(count: int, snapshots: int) -> list[Path]:
        folder = tmp_path_factory.mktemp("campaign")
        scan = {"azimuth": [0.0, 60.0, 120.0, 180.0, 240.0, 300.0], "elevation": [0.0]}
        sounder = description(waveform=WAVEFORM, scan=scan, rx_antenna=HORN)
        write_back_to_back(receiver.back_to_back(sounder, 60.0), folder / "b2b.h5", history="test")
        columns = {"delay": [50e-9], "azimuth": [70.0], "elevation": [0.0], "coefficient": [1e-6 + 0j]}
        paths = xr.Dataset({name: ("path", values) for name, values in columns.items()})
        files = [folder / f"P{number}.h5" for number in range(count)]
        for number, file in enumerate(files):
            places = {"tx_position": (0, 0, 1), "rx_position": (3 + number % 9, 4, 1)}
            made = receiver.record(paths, sounder, name=file.stem, snapshots=snapshots, seed=number, **places)
            write_recording(made, file, history="test")
        return [*files, folder / "b2b.h5"]

    return make
