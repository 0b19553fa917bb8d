"""Each option of a stage has a few values; another is refused where the user called."""

import numpy as np
import pytest

import sounder
from erm import OptionError
from sounder import shipped


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
    with pytest.raises(OptionError, match="threshold is '12'; expected one of usc, nyu"):
        sounder.extract_mpcs(responses, deembedding, recording.sounder, threshold="12")
