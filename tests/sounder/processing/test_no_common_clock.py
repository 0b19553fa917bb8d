"""Captures that begin at any time give the delays of those that begin with the transmitter's."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from erm.common.constants import c
from sounder.cir.impulse_response import calibrate
from sounder.options import Options
from sounder.processing.position import process_recording
from sounder.processing.remarks import remarks_on_position
from sounder.remark import Code
from sounder.twin import receiver

from .test_pipeline import HORN, WAVEFORM

TX, RX = (0.0, 0.0, 1.0), (3.0, 4.0, 1.0)
DISTANCE = 5.0
START = 77
"""Samples that the captures begin late."""


@pytest.mark.slow
def test_delays_refer_to_the_first_arrival_wherever_the_captures_begin(description):
    scan = {"azimuth": [0.0, 60.0, 120.0, 180.0, 240.0, 300.0], "elevation": [0.0]}
    sounder = description(waveform=WAVEFORM, scan=scan, rx_antenna=HORN, clock={"start": "arbitrary"})
    columns = {
        "delay": [DISTANCE / c, 60e-9],
        "azimuth": [233.13, 100.0],  # toward the transmitter, and of a reflection that is stronger
        "elevation": [0.0, 0.0],
        "coefficient": [1e-6 + 0j, 3e-6j],
    }
    paths = xr.Dataset({name: ("path", values) for name, values in columns.items()})
    b2b = receiver.back_to_back(sounder, 60.0)
    made = receiver.record(paths, sounder, name="P", snapshots=2, tx_position=TX, rx_position=RX, los=1)
    filter_ = calibrate(b2b, made)

    late = replace(made, read=lambda a, e, s: np.roll(made.read(a, e, s), START, axis=1))
    groups, remarks = process_recording(late, filter_, Options(), threads=1)
    delay = np.sort(groups["/mpc"]["delay"].values)
    assert groups["/"].attrs["delay_reference"].startswith("first arrival")
    assert delay[0] == pytest.approx(DISTANCE / c, abs=1e-15)
    assert np.abs(delay - (60e-9)).min() < 4 * np.median(groups["/mpc"]["delay_std"].values)
    pdp = groups["/daps"]["daps"].max(("azimuth", "elevation"))
    assert float(pdp.idxmax()) == pytest.approx(60e-9, abs=1 / WAVEFORM["sample_rate"])
    assert Code.NO_CLOCK not in {remark.code for remark in remarks}
    hidden = remarks_on_position(replace(late, los=0), groups, filter_)  # the first arrival is no direct path
    assert Code.NO_CLOCK in {remark.code for remark in hidden}
