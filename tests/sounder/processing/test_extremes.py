"""Numbers at the ends of what a recording can hold: right, or refused by name; warnings are errors."""

from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import sounder
from erm.common.errors import DataError
from sounder import shipped
from sounder.options import Options
from sounder.processing.position import process_recording
from sounder.recordings.native import back_to_back
from sounder.recordings.recording import check
from sounder.remark import Code

from ..strategies import WHOLE, recordings

B2B = back_to_back(shipped.calibration("back-to-back-132ghz.h5"))


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(recording=recordings(), averaging=st.sampled_from(["coherent", "power", "phase-aligned"]))
@example(recording=WHOLE, averaging="coherent")
def test_any_recording_gives_finite_mpcs_or_is_refused(recording, averaging):
    groups = {}
    with suppress(DataError):
        check(recording, 1022)
        filter_ = sounder.calibrate(B2B, recording)
        groups, _ = process_recording(recording, filter_, Options(averaging=averaging), threads=1)
    for name in ("delay", "azimuth", "path_gain") if groups else ():
        assert np.isfinite(groups["/mpc"][name].values).all()


def test_a_direction_of_huge_samples_is_left_out_like_one_of_nan():
    def read(a, e, snapshots=slice(None)):
        captures = WHOLE.captures(a, e, snapshots).astype(np.float32).view(np.complex64)[..., 0]
        captures[0, 5] = 1e26 if (a, e) == (2, 1) else captures[0, 5]
        return captures

    _, remarks = sounder.impulse_responses(replace(WHOLE, read=read), sounder.calibrate(B2B, WHOLE))
    assert [(remark.code, remark.azimuth) for remark in remarks] == [(Code.NOT_FINITE, WHOLE.azimuth[2])]


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"agc_gain": np.full((9, 3), 1e4)}, "agc_gain is 10000 dB; expected at most 200 dB"),
        ({"rx_position": np.array([1e308, 0, 0])}, "expected three finite numbers [m] of a place on earth"),
        ({"elevation": np.array([-900.0, 0.0, 900.0])}, "expected -90 to 90 degrees"),
    ],
)
def test_what_cannot_be_is_refused_by_name(change, line):
    with pytest.raises(DataError) as caught:
        check(replace(WHOLE, **change), 1022)
    assert line in str(caught.value)


def test_scales_that_cannot_both_hold_are_refused():
    with pytest.raises(DataError, match="are 6000 dB apart; expected at most 200 dB"):
        sounder.calibrate(B2B, replace(WHOLE, scale_factor=B2B.scale_factor * 1e300))


def test_antennas_a_millimetre_apart_are_two_places_wherever_they_are():
    tx, rx = np.array([[1e6, -1e6, 30.0], [1e6 + 1e-3, -1e6, 30.0]])
    check(replace(WHOLE, tx_position=tx, rx_position=rx), 1022)
