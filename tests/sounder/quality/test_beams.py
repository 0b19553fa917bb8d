"""What beams say of one another."""

import numpy as np
import pytest

from sounder import load_sounder
from sounder.instrument.antenna_pattern import Pattern
from sounder.quality.beams import Neighbours, contradictions, find_paths
from sounder.shipped import calibration

DELAY = 300


@pytest.mark.parametrize(("level", "told"), [(4.0, False), (20.0, True)])
def test_a_beam_lacks_the_strongest_path_only_where_others_see_it_clearly(level, told):
    # a path in one beam, and in the sidelobes of all others at one level [dB over the noise]; one beam has only noise
    horn = load_sounder(calibration("sounder-132ghz.toml")).rx_antenna
    azimuth = np.arange(0.0, 360.0, 10.0)
    near = Neighbours.of(azimuth, np.zeros(1), horn)
    snr = np.random.default_rng(1).exponential(1.0, (azimuth.size, 1022)).astype(np.float32)
    lobe = 42 + Pattern.of(horn).beam_gain(0.0, 0.0, azimuth, np.zeros(azimuth.size))
    snr[:, DELAY] = 10 ** (np.maximum(lobe, level) / 10)
    snr[18, DELAY - 2 : DELAY + 3] = 0.04
    against = contradictions(find_paths(snr, near), snr)
    assert (against[18] > 0) == told
    assert not np.delete(against, 18).any()


def test_three_beams_that_agree_about_a_path_of_their_own_absolve_none_of_them():
    # level and two angles fit any three powers; each of the three sees a stronger path that no other beam sees
    horn = load_sounder(calibration("sounder-132ghz.toml")).rx_antenna
    azimuth = np.arange(0.0, 360.0, 10.0)
    near = Neighbours.of(azimuth, np.zeros(1), horn)
    snr = np.random.default_rng(2).exponential(1.0, (azimuth.size, 1022)).astype(np.float32)
    lobe = 40 + Pattern.of(horn).beam_gain(2.5, 0.0, azimuth, np.zeros(azimuth.size))
    slipped = [35, 0, 1]
    snr[slipped, DELAY] = 10 ** (lobe[slipped] / 10)
    for number, beam in enumerate(slipped):
        snr[beam, 100 + 50 * number] = 1e5
    paths = find_paths(snr, near)
    assert paths.consistent[paths.delay == DELAY].all()
    assert (contradictions(paths, snr)[slipped] > 0).all()


@pytest.mark.parametrize(("slipped", "told"), [(False, False), (True, True)])
def test_what_beams_two_steps_away_see_by_chance_does_not_vouch_for_a_beam_that_slipped(slipped, told):
    # a path on the boresight of beam 18 is 12 dB weaker in both next beams; those beyond them see others at its delay
    horn = load_sounder(calibration("sounder-132ghz.toml")).rx_antenna
    azimuth = np.arange(0.0, 360.0, 10.0)
    near = Neighbours.of(azimuth, np.zeros(1), horn)
    snr = np.random.default_rng(3).exponential(1.0, (azimuth.size, 1022)).astype(np.float32)
    lobe = 34 + Pattern.of(horn).beam_gain(180.0, 0.0, azimuth, np.zeros(azimuth.size))
    seen = [18] if slipped else [17, 18, 19]
    snr[seen, DELAY] = 10 ** (lobe[seen] / 10)
    snr[[16, 20], DELAY] = 10**1.4, 10**0.7
    assert (contradictions(find_paths(snr, near), snr)[18] > 0) == told
