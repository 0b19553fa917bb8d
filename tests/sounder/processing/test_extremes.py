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

[WHOLE] = sounder.open_recordings(shipped.calibration("recording-132ghz.h5"))
B2B = back_to_back(shipped.calibration("back-to-back-132ghz.h5"))
GAINS = [1e-320, -13.0, 60.0, 150.0, -190.0, 201.0, 1e4, -1e4, 1e308, np.inf, np.nan]
PLACES = [0.0, 5e-324, 1e-3, 1.0, 1e6, 1e9, 1e308, -np.inf, np.nan]
SCALES = [1.0, 10.0, 1e-9, 1e9, 1e40, 1e300, 1e-300]


@st.composite
def recordings(draw):
    """Subsets of the directions and snapshots of a clean recording, with other captures, gains, scales and places."""
    azimuths = draw(st.sampled_from([slice(None), slice(7, 8), slice(6, 9)]))
    elevations = draw(st.sampled_from([slice(None), slice(1, 2)]))
    captures = np.array([[WHOLE.captures(a, e) for e in range(3)] for a in range(9)])[azimuths, elevations]
    captures = captures[:, :, : draw(st.integers(1, 2))]
    value = draw(st.sampled_from([None, None, None, 0, 1, 32767]))
    captures = captures if value is None else np.full_like(captures, value)
    gain = WHOLE.agc_gain[azimuths, elevations].copy()
    if draw(st.booleans()):
        gain += draw(st.sampled_from(GAINS))
    gain[0, 0] += draw(st.sampled_from([0.0, 0.0, *GAINS]))
    valid = WHOLE.valid[azimuths, elevations] & (draw(st.integers(0, 4)) > 0)
    return replace(
        WHOLE,
        azimuth=WHOLE.azimuth[azimuths],
        elevation=WHOLE.elevation[elevations] * draw(st.sampled_from([1.0, 1.0, 11.0])),
        snapshots=captures.shape[2],
        rx_position=np.array([draw(st.sampled_from(PLACES)), 0.0, 1.4]),
        scale_factor=WHOLE.scale_factor * draw(st.sampled_from(SCALES)),
        agc_gain=gain,
        valid=valid,
        time=None,
        read=lambda a, e, snapshots=slice(None): captures[a, e, snapshots],
    )


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
