"""Random recordings, for what holds for all of them."""

from dataclasses import replace

import numpy as np
from hypothesis import strategies as st

import sounder
from sounder import shipped

[WHOLE] = sounder.open_recordings(shipped.calibration("recording-132ghz.h5"))
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
    with np.errstate(over="ignore"):  # twice 1e308 dB are infinite
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
