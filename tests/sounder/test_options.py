"""Each option of a stage has a few values; another is refused where the user called."""

import numpy as np
import pytest

import sounder
from erm import OptionError
from sounder import shipped
from sounder.options import Threshold


@pytest.fixture(scope="module")
def cir():
    recordings, b2b = [shipped.calibration("recording-132ghz.h5")], shipped.calibration("back-to-back-132ghz.h5")
    (job,), _ = sounder.gather(recordings, calibration=b2b)
    deembedding = sounder.calibrate(job.b2b, job.recording)
    return sounder.impulse_responses(job.recording, deembedding)[0], deembedding, job.recording


def test_a_stage_refuses_a_value_that_it_does_not_know(cir):
    responses, deembedding, recording = cir
    assert np.isfinite(responses["cir"].values).any()
    with pytest.raises(OptionError, match="averaging is 'mean'; expected one of coherent, phase-aligned, power"):
        sounder.impulse_responses(recording, deembedding, averaging="mean")
    with pytest.raises(OptionError, match="omnidirectional is 'mean'; expected one of sum, maximum"):
        sounder.daps(responses, recording.sounder, omnidirectional="mean")
    with pytest.raises(OptionError, match="method is 'music'; expected one of sage, clean, peaks"):
        sounder.extract_mpcs(responses, deembedding, recording.sounder, method="music")
    with pytest.raises(
        OptionError, match="threshold is 'loud'; expected one of cfar, usc, nyu, or numbers: dB over the noise"
    ):
        sounder.extract_mpcs(responses, deembedding, recording.sounder, threshold="loud")


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "threshold is ''; expected"),
        ("1,2,3,4", "threshold is '1,2,3,4'; expected"),
        ("-3", "threshold: noise_margin is -3; expected 0 or more"),
        ("12,nan", "threshold: dynamic_range is nan; expected 0 or more"),
        ("12,30,0", "threshold: delay_gate is 0; expected more than 0"),
        ("cfar:0", "threshold: false_alarms is 0; expected more than 0"),
        ("cfar:", "threshold is 'cfar:'; expected"),
    ],
)
def test_numbers_that_are_no_threshold_are_refused(text, problem):
    with pytest.raises(OptionError, match=problem):
        sounder.Options(threshold=text)


def test_a_threshold_is_written_in_one_way():
    written = {"12": "usc", "5,25": "nyu", "5,25,inf": "nyu", "12,inf,4e-7": "12,inf,4e-07", "10,30.5": "10,30.5"}
    written |= {"cfar": "cfar", "cfar:0.05,inf": "cfar", "cfar:0.010,30": "cfar:0.01,30"}
    for text, expected in written.items():
        assert sounder.Options(threshold=text).threshold == expected
        assert Threshold.of(expected) == Threshold.of(text)
