"""Lost samples, slips and drift from delays of paths in overlapping beams."""

from dataclasses import replace

import numpy as np
import pytest

from sounder.quality.clock import clock_drift, lost_samples
from sounder.quality.delays import Delays
from sounder.quality.shapes import Shapes
from sounder.quality.slips import slips, unsettled

BEAMS, PATHS, SEEN, APART = 108, 12, 15, 40
ORDER = np.arange(BEAMS).reshape(3, 36).T.ravel()  # beams are azimuth-major, the scan covers an elevation at a time


def delays(seed, offset, std=0.05):
    """Each path is seen by five azimuths at all three elevations."""
    rng = np.random.default_rng(seed)
    azimuth = (rng.integers(0, 36, (PATHS, 1)) + np.arange(5)) % 36
    beam = (3 * azimuth[..., None] + np.arange(3)).reshape(PATHS, SEEN).ravel()
    path = np.repeat(np.arange(PATHS), SEEN)
    own = rng.uniform(-0.5, 0.5, PATHS)[path]
    return Delays(
        path,
        beam,
        own + offset[beam] + std * rng.normal(size=beam.size),
        np.full(beam.size, 5 * std),
        np.zeros(beam.size, bool),
        APART * (path + 1),
    )


def shapes(delays, apart=None):
    """Responses with a Gaussian pulse at each delay; where ``apart`` (beam,) is not 0, two of which it is the mean."""
    time = np.arange(APART * (int(delays.path.max()) + 2))
    half = np.zeros(BEAMS) if apart is None else apart / 2
    late = (delays.sample + delays.delay)[:, None] - time
    seen = sum(np.exp(-((late + sign * half[delays.beam, None]) ** 2) / 2) for sign in (-1, 1))
    responses = np.zeros((BEAMS, time.size), complex)
    np.add.at(responses, delays.beam, seen)
    return Shapes(responses, np.full(BEAMS, 1e-4))


def test_nothing_is_found_in_clean_delays():
    for seed in range(20):
        clean = delays(seed, np.zeros(BEAMS))
        assert lost_samples(clean, ORDER) == (0, 0)
        assert not slips(clean, shapes(clean), 3).any()
        drift, bound = clock_drift(clean, ORDER)
        assert abs(drift) < bound


@pytest.mark.parametrize(("first", "shift"), [(30, -2), (50, 3), (75, -4)])
def test_samples_lost_during_the_scan(first, shift):
    found = lost_samples(delays(1, np.where(first <= ORDER, shift, 0.0)), ORDER)
    assert found[1] == shift
    assert abs(found[0] - first) <= 12  # no path is seen by every beam


def test_a_loss_of_samples_is_one_that_shifts_what_beams_see():
    """Paths that are later in later beams by themselves shift no pulse: the beams see two that are not resolved."""
    first, shift = 50, 3
    lost = delays(1, np.where(first <= ORDER, shift, 0.0))
    later = ORDER[lost.beam] >= first
    assert shapes(lost).explain_loss(lost, later, shift)
    assert not shapes(lost, np.where(first <= ORDER, 2.0 * shift, 0.0)).explain_loss(lost, later, shift)
    clean = delays(1, np.zeros(BEAMS))
    assert not shapes(clean).explain_loss(clean, later, shift)


def test_beams_that_slipped_by_whole_samples_are_found():
    offset = np.zeros(BEAMS)
    slipped = np.unique(delays(2, offset).beam)[::9]
    offset[slipped] = np.resize([1, -1, 1], slipped.size)
    late = delays(2, offset)
    np.testing.assert_array_equal(slips(late, shapes(late), 3), offset)


def test_beams_between_two_paths_are_not_slipped():
    """Two paths as strong that are not resolved look like one in the middle, but for the shape."""
    offset = np.zeros(BEAMS)
    moved = np.unique(delays(2, offset).beam)[::9]
    offset[moved] = np.linspace(0.6, 1.4, moved.size)
    late = delays(2, offset)
    assert slips(late, shapes(late), 3).any()
    assert not slips(late, shapes(late, 2 * offset), 3).any()


def test_the_lower_beams_that_see_a_reflection_off_the_ground_are_not_slipped():
    clean = delays(2, np.zeros(BEAMS))
    low = np.unique(clean.beam[(clean.path == 0) & (clean.beam % 3 == 0)])
    offset = np.zeros(BEAMS)
    offset[low] = 1.0
    assert low.size == 5
    late = delays(2, offset)
    assert not slips(late, shapes(late), 3).any()
    assert not unsettled(delays(2, offset), BEAMS, 3)[low].any()
    offset[low[::2]] = -1.0  # no reflection does this
    late = delays(2, offset)
    assert slips(late, shapes(late), 3)[low].tolist()[:4] == [-1, 1, -1, 1]


def test_the_drift_of_a_clock_is_measured_beside_a_slip():
    offset = 0.24 * ORDER / BEAMS  # 0.2 ns at 1.2 GHz
    offset[5] += 1
    drift, bound = clock_drift(delays(3, offset), ORDER)
    assert drift * BEAMS == pytest.approx(0.24, abs=bound * BEAMS)
    assert bound * BEAMS < 0.1


@pytest.mark.parametrize("total", [-2.4, 0.24, 1.2, 3.0])
def test_a_drift_is_no_loss_of_samples(total):
    for seed in range(5):
        drifting = delays(seed, total * ORDER / BEAMS)
        assert lost_samples(drifting, ORDER) == (0, 0)
        drift, bound = clock_drift(drifting, ORDER)
        assert drift * BEAMS == pytest.approx(total, abs=bound * BEAMS)


def test_one_path_in_the_sidelobes_of_all_beams_tells_a_drift():
    rng = np.random.default_rng(4)
    beam, same = np.arange(BEAMS), np.zeros(BEAMS, int)
    for total in (0.0, 0.24):
        late = total * ORDER / BEAMS + 0.05 * rng.normal(size=BEAMS)
        seen = Delays(same, beam, late, np.full(BEAMS, 0.25), np.ones(BEAMS, bool), same)
        drift, bound = clock_drift(seen, ORDER)
        assert abs(drift - total / BEAMS) < bound
        assert (abs(drift) > bound) == (total > 0)


def test_reflections_off_the_ground_are_no_lost_samples():
    """The lower beams of every other path are later by its own excess, right at a change of elevation in the scan."""
    for seed in range(20):
        clean = delays(seed, np.zeros(BEAMS))
        excess = np.random.default_rng([1, seed]).uniform(0.5, 4, PATHS) * (np.arange(PATHS) % 2)
        excess = excess[clean.path] * (clean.beam % 3 == 0)
        assert lost_samples(replace(clean, delay=clean.delay + excess), ORDER) == (0, 0)


def test_all_beams_of_a_main_lobe_slipped_where_sidelobes_settle_the_path():
    rng = np.random.default_rng(5)
    lobe, same = np.arange(30, 39), np.zeros(BEAMS, int)
    offset, far = np.zeros(BEAMS), np.ones(BEAMS, bool)
    offset[lobe], far[lobe] = [1, -1, -1, -1, 1, 1, 1, -1, 1], False
    late = offset + 0.02 * rng.normal(size=BEAMS) - 0.2 * ~far  # another path, not resolved, is seen in the main lobe
    seen = Delays(same, np.arange(BEAMS), late, np.full(BEAMS, 0.25), far, same + APART)
    np.testing.assert_array_equal(slips(seen, shapes(seen), 3), offset)
    few = ~far | (np.arange(BEAMS) < 9)  # nine that disagree, nine others that agree
    seen = Delays(*(column[few] for column in vars(seen).values()))
    np.testing.assert_array_equal(slips(seen, shapes(seen), 3), offset)
