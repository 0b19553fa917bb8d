"""The summary of a file is true."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from erm.common.errors import DataError
from erm.common.storage import write_product
from sounder.processing.recording_summary import describe_back_to_back, describe_recording
from sounder.processing.summary import _noise_floor, describe_file
from sounder.recordings.writer import write_recording
from sounder.twin import receiver
from sounder.twin.faults import DCOffset, Faults

WAVEFORM = {"order": 7, "polynomial": [7, 1, 0], "chip_rate": 6e8, "samples_per_chip": 2, "sample_rate": 1.2e9}


@pytest.fixture(scope="module")
def sounder(description):
    flat = {"pattern": "flat", "cut": None, "gain": 0.0}
    scan = {"azimuth": [0.0, 180.0], "elevation": [0.0]}
    return description(waveform=WAVEFORM, scan=scan, rx_antenna=flat, tx_antenna=flat, transmitter={"power": 0.0})


def recording(sounder, gain: float = -60.0, **changes):
    """Recording of one path of a given gain [dB] by an instrument without noise."""
    zero = {name: ("path", np.zeros(1)) for name in ("delay", "azimuth", "elevation")}
    paths = xr.Dataset({**zero, "coefficient": ("path", [10 ** (gain / 20) + 0j])})
    places = {"tx_position": (0, 0, 1), "rx_position": (1, 2.346, 3)}
    made = receiver.record(
        paths, sounder, name="P", snapshots=2, faults=changes.pop("faults", Faults.absent()), **places
    )
    return replace(made, **changes)


@pytest.mark.parametrize("agc", [False, True])
def test_received_power_is_that_at_the_antenna_whatever_the_gain(sounder, agc):
    # 0 dBm through -60 dB; the gain control lifts it by a known amount
    shown = dict(describe_recording(recording(sounder, faults=Faults.absent(agc=agc))))
    assert shown["received power"] == "-60.0 to -60.0 dBm over the directions"


def test_power_of_complex_samples_is_that_of_int16(sounder):
    made = recording(sounder)
    complex_ = replace(made, read=lambda a, e, s: (made.captures(a, e, s) @ np.array([1, 1j])).astype(np.complex64))
    assert describe_recording(complex_) == describe_recording(made)


def test_health_counts_directions(sounder):
    made = recording(sounder)
    zero = replace(made, read=lambda a, e, s: made.captures(a, e, s) * np.int16(a))
    assert dict(describe_recording(zero))["health"] == "no direction missing, 1 all zero, none clipped"
    clipped = recording(sounder, gain=-30.0)  # 12 dB over full scale
    assert dict(describe_recording(clipped))["health"] == "no direction missing, none zero, 2 clipped"
    missing = replace(made, valid=np.array([[False], [True]]))
    assert dict(describe_recording(missing))["health"].startswith("1 direction missing")
    nothing = replace(made, read=lambda a, e, s: made.captures(a, e, s) * np.int16(0))
    assert dict(describe_recording(nothing))["received power"] == "none"


@pytest.mark.parametrize(("los", "shown"), [(1, "yes"), (0, "no"), (-1, "not known")])
def test_line_of_sight_in_words(sounder, los, shown):
    assert dict(describe_recording(recording(sounder, los=los)))["line of sight"] == shown


def test_position_in_metres(sounder):
    assert dict(describe_recording(recording(sounder)))["RX position"] == "1.00, 2.35, 3.00 m"


def test_back_to_back_shows_the_sequence_it_holds_not_the_described_one(description, sounder):
    other = description(waveform={**WAVEFORM, "polynomial": [7, 3, 0]}, scan={"azimuth": [0.0], "elevation": [0.0]})
    made = receiver.back_to_back(other, 60.0, faults=Faults.absent(dc_offset=DCOffset()))
    shown = dict(describe_back_to_back(replace(made, sounder=sounder)))
    assert shown["sequence found"].startswith("order 7, polynomial [7, 3, 0] forward, positive, 2 samples per chip; ")
    assert shown["sequence found"].endswith("; differs from the description: order 7, polynomial [7, 1, 0] forward")
    assert shown["attenuation"] == "60 dB (nominal)"
    silent = replace(made, captures=np.zeros_like(made.captures))
    assert "no m-sequence of order 7 stands out" in dict(describe_back_to_back(silent))["sequence found"]


def test_a_sequence_is_the_same_as_that_of_the_reciprocal_polynomial_backwards(description):
    one = {"azimuth": [0.0], "elevation": [0.0]}
    described = description(waveform={**WAVEFORM, "polynomial": [7, 6, 0], "direction": "reversed"}, scan=one)
    made = receiver.back_to_back(described, 60.0, faults=Faults.absent(dc_offset=DCOffset()))
    shown = dict(describe_back_to_back(made))["sequence found"]
    assert shown.startswith("order 7, polynomial [7, 1, 0] forward, ")
    assert shown.endswith("; agrees with the description: order 7, polynomial [7, 6, 0] reversed")


def test_a_file_of_another_kind_is_reported(tmp_path, sounder):
    write_recording(recording(sounder), tmp_path / "raw.h5", history="test")
    assert ("position", "P") in describe_file(tmp_path / "raw.h5")
    write_product({"/": xr.Dataset({"x": ("y", [1.0])})}, tmp_path / "other.h5")
    with pytest.raises(DataError, match="not a recording of a known format"):
        describe_file(tmp_path / "other.h5")
    with pytest.raises(DataError, match="no such file"):
        describe_file(tmp_path / "none.h5")


def test_a_product_without_a_noise_floor_says_so():
    assert _noise_floor(np.array([-100.0, np.nan, -98.0])) == "-99.0 dB (median over directions)"
    assert _noise_floor(np.full((2, 1), np.nan)) == _noise_floor(np.zeros(0)) == "of no direction"
