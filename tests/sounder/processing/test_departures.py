"""A sweep with beams at both ends, from a foreign file to its product."""

from dataclasses import replace

import h5py
import numpy as np
import pytest

import sounder
from erm.common.errors import DataError
from sounder.instrument.antenna_pattern import Pattern
from sounder.processing.position import process_recording
from sounder.processing.recording_summary import describe_recording
from sounder.recordings.writer import write_recording

LAYOUT = """
[captures]
kind = "ctf"
dataset = "S21"
axes = ["frequency", "position * azimuth * tx_azimuth"]
frequency = { dataset = "frequency" }
[grid]
azimuth = [120, 110, 100, 90, 80, 70, 60]
elevation = [0]
tx_azimuth = [-20, -10, 0, 10, 20]
[positions]
tx = [0, 0, 2]
rx = [[0, 9, 2], [0, 8, 2]]
[sounder]
name = "two beam-switching arrays"
[sounder.tx_antenna]
gain = 12.0
pattern = "gaussian"
hpbw_azimuth = 12.0
hpbw_elevation = 30.0
[sounder.rx_antenna]
gain = 15.0
pattern = "gaussian"
hpbw_azimuth = 12.0
hpbw_elevation = 30.0
"""
FREQUENCY = np.linspace(59e9, 61e9, 201)
PATHS = [(-80.0, 40e-9, 83.0, -12.0), (-85.0, 55e-9, 104.0, 7.0)]
"""Gain [dB], delay [s], azimuth of arrival and of departure [degree]."""


@pytest.fixture(scope="module")
def jobs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("both")
    (folder / "layout.toml").write_text(LAYOUT, encoding="utf-8")
    azimuth, tx_azimuth = np.arange(120.0, 59, -10), np.arange(-20.0, 21, 10)
    rng = np.random.default_rng(2)
    s21 = 1e-6 * (rng.standard_normal((2, 7, 5, 201, 2)) @ [1, 1j])
    described = sounder.load_sounder(sounder.shipped.calibration("sounder-132ghz.toml")).rx_antenna
    lobe = described.model_copy(
        update={"pattern": "gaussian", "cut": None, "hpbw_azimuth": 12.0, "hpbw_elevation": 30.0}
    )
    horn = Pattern.of(lobe)
    for gain, delay, arrival, departure in PATHS:
        at_rx, at_tx = horn.beam_gain(arrival, 0.0, azimuth, 0.0), horn.beam_gain(departure, 0.0, tx_azimuth, 0.0)
        amplitude = 10 ** ((gain + 12 + 15 + at_rx[:, None] + at_tx) / 20) * np.exp(2j * np.pi * rng.random((2, 7, 5)))
        s21 += amplitude[..., None] * np.exp(-2j * np.pi * FREQUENCY * delay)
    with h5py.File(folder / "both.h5", "w") as file:
        file["frequency"], file["S21"] = FREQUENCY, s21.reshape(70, 201).T
    jobs, failures = sounder.gather([folder / "both.h5"], layout=folder / "layout.toml")
    assert not failures
    return jobs


@pytest.mark.slow
def test_the_product_holds_both_ends(jobs):
    recording = jobs[1].recording
    assert len(recording.departures) == 5
    assert ("TX directions", "5 azimuths x 1 elevations") in describe_recording(recording)
    filter_ = sounder.calibrate(jobs[1].b2b, recording)
    groups, remarks = process_recording(recording, filter_, sounder.Options())
    assert not [remark for remark in remarks if remark.of_direction]
    mpc, daps = groups["/mpc"], groups["/daps"]
    assert mpc.sizes["mpc"] == 2
    for i, (gain, delay, arrival, departure) in enumerate(PATHS):
        error = {
            "delay": delay - mpc["delay"][i],
            "azimuth": arrival - mpc["azimuth"][i],
            "departure_azimuth": (departure - mpc["departure_azimuth"][i] + 180) % 360 - 180,
            "path_gain": gain - mpc["path_gain"][i],
        }
        for name, value in error.items():
            assert abs(value) < 4 * mpc[f"{name}_std"][i], name
    assert np.isnan(mpc["departure_elevation"]).all()  # the transmit antenna was not tilted
    links = daps["double_directional_daps"]
    assert links.dims == ("tx_azimuth", "tx_elevation", "azimuth", "elevation", "delay")
    strongest = links.where(links == links.max(), drop=True)
    assert (strongest["tx_azimuth"].item(), strongest["azimuth"].item()) == (-10.0, 80.0)
    # as if the transmit antenna were omnidirectional: the sum over its beams has the path's gain
    assert float(daps["pdp"].max()) == pytest.approx(PATHS[0][0], abs=2.0)


def test_a_native_recording_holds_one_beam(jobs, tmp_path):
    one = jobs[0].recording.departures[0]
    with pytest.raises(DataError, match="the transmit antenna has 5 beams"):
        write_recording(replace(jobs[0].recording, kind="iq"), tmp_path / "x.h5", history="")
    assert one.departures == [one]
