"""The layouts of other groups' sweeps read every sample as an independent reader does."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat

import sounder
from sounder.processing.departures import checked_responses

EXAMPLES = Path(__file__).parents[4] / "examples/layouts"


def jobs_of(name, data):
    jobs, failures = sounder.gather([data], layout=EXAMPLES / name)
    assert not failures
    return jobs


@pytest.mark.slow
def test_links_of_antennas_at_several_places(shared_data):
    file = shared_data / "instrument/vna60/CTF.mat"
    s21 = loadmat(file)["CTF_mat"].astype(np.complex64)
    jobs = jobs_of("vna60.toml", file)
    assert len(jobs) == 16
    for number, job in enumerate(jobs):
        np.testing.assert_array_equal(job.recording.captures(0, 0)[0], s21[number // 4, number % 4])
    assert jobs[0].recording.sounder.carrier.frequency == 60e9


@pytest.mark.slow
def test_beams_at_both_ends(shared_data):
    """A 28 GHz scan of 11 x 11 beams in seven repeats: the two strongest paths, which left 13 degrees apart.

    Mirrors at 24 ns are the instrument's.
    """
    file = shared_data / "instrument/vna28/sm_sub17_er.mat"
    s21 = loadmat(file, squeeze_me=True, struct_as_record=False)["MeasData"].S21.astype(np.complex64)
    jobs = jobs_of("vna28.toml", file)
    assert len(jobs) == 7
    filter_ = sounder.calibrate(jobs[0].b2b, jobs[0].recording)
    strongest, departures = [], []
    for repeat, job in enumerate(jobs):
        beams = job.recording.departures
        for rx, tx in ((0, 10), (4, 7)):
            sweep = s21[:, (repeat * 11 + rx) * 11 + tx]
            np.testing.assert_array_equal(beams[tx].captures(rx, 0)[0], sweep)
        cir, _ = checked_responses(job.recording, filter_, sounder.Options())
        mpcs = sounder.extract_mpcs(cir, filter_, job.recording.sounder, threshold="12,25,1", distance=5.0)
        assert not np.any(np.abs(np.abs(mpcs["delay"] - mpcs["delay"][0]) - 24e-9) < 1e-9)
        strongest.append(mpcs["delay"].values[:2])
        departures.append((mpcs["departure_azimuth"].values[:2] + 180) % 360 - 180)
        assert (np.abs((mpcs["azimuth"].values[:2] + 180) % 360 - 180) < 3).all()
    assert (np.std(strongest, axis=0) < 0.06e-9).all(), np.std(strongest, axis=0)
    np.testing.assert_allclose(np.mean(departures, axis=0), [5, -8], atol=2)
