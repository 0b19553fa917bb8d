"""A small recording, and its file."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from sounder.recordings.recording import Recording
from sounder.recordings.writer import write_recording
from sounder.twin import receiver

from .files import SCAN, WAVEFORM


@pytest.fixture(scope="module")
def sounder(description):
    return description(waveform=WAVEFORM, scan=SCAN)


@pytest.fixture(scope="module")
def recording(sounder) -> Recording:
    """Noise of the instrument, with its gain control and its clock."""
    none = {name: ("path", np.zeros(0)) for name in ("delay", "azimuth", "elevation", "coefficient")}
    recorded = receiver.record(
        xr.Dataset(none),
        sounder,
        name="P 1",
        tx_position=(0.1, -2.3, 28.4),
        rx_position=(31.06, -46.64, 1.4),
        snapshots=3,
        los=0,
    )
    return replace(recorded, time=1.7e9 + np.arange(float(recorded.valid.size)).reshape(recorded.valid.T.shape).T)


@pytest.fixture
def path(tmp_path: Path, recording: Recording) -> Path:
    write_recording(recording, tmp_path / "p1.h5", history="test")
    return tmp_path / "p1.h5"
