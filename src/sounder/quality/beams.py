"""Beams that overlap see the same paths: at one delay, and with the gains of the antenna pattern."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from sounder.instrument.antenna_description import Antenna
from sounder.instrument.antenna_pattern import Pattern
from sounder.mpc.directions import beam_directions, beam_gains, wrap

Real = NDArray[np.float64]
Integers = NDArray[np.int64]

REACH = 2.2
"""Angle up to which beams are compared [half-power beamwidth]; a Gaussian lobe is at -58 dB there."""
STEPS = 17
"""Directions of a path that are tried in either angle."""
MIN_SNR = 100.0
"""Peak power over the noise of a path that is compared: 20 dB."""
MAX_PATHS = 64
"""Strongest paths that are compared."""
FINE = 9
"""Directions of the finer search in either angle, over two steps of the coarse one."""
CLEAR = 13.0
"""Power over the noise of a path that is clear in a beam [dB]: exp(-20) a sample of noise."""
NOISE = 2.0
"""Largest of five samples of noise, in the mean: 1 + 1/2 + 1/3 for three independent ones; neighbours are not."""
NOTHING = 1e-3
"""Power over the noise that stands for none."""
MAIN_LOBE = -13.0
"""Relative gain from which a beam counts as in the main lobe [dB]: the next beam of a scan in steps of a beamwidth."""
AGREEMENT = 2.0
"""Difference from the expected power up to which a beam agrees [dB]: noise at 13 dB has a standard deviation of 1.2."""
LARGEST = 4.0
"""Largest difference that counts in a fit [dB]."""
MIN_BEAMS = 3
"""Beams that must agree about a path: level and two angles."""
MIN_SHARE = 0.6
"""Share of the clear beams that must agree about a path."""
UNSEEN = 10.0
"""Power over the noise up to which a beam sees nothing [dB]: exp(-10) = 5e-5 a sample of noise."""
MISSING = 11.0
"""Power that a path lacks in a beam for it to be missing, if nothing is seen there [dB]. Two paths at one delay and
from directions that are a beam apart seldom cancel so far: in 102 clean positions by 9 dB, down to the noise."""
SPREAD = 3.0
"""Interquartile ranges below the quartile to which sidelobes that all beams have may fall; chosen."""
EXPECTED = 17.0
"""Expected power over the noise from which a path can be missing [dB]: the fit errs by some decibels."""
PROFILE = 8.0
"""Power over the noise from which a profile counts: exp(-8) = 3e-4 of the samples of noise."""
APART = 4
"""Shifts closer than this to the best one are the same one [sample]."""
UNIQUE = 0.75
"""Largest cross-correlation elsewhere, relative to the best, for a shift to be certain. Chosen."""
NOWHERE = -300.0
"""Gain of a beam that there is not [dB]."""
FADING = 5.0
"""Power that a path may lose in the best of the beams about its own besides that by the pattern [dB], if this takes it
into the noise. Chosen."""


@dataclass(frozen=True)
class Neighbours:
    """Beams about each beam, and the antenna's gains in them toward directions about its boresight.

    Attributes
    ----------
    beam : array (beam, near)
        Numbers of the beams; the beam itself first; -1 where there are fewer.
    gain : array (beam, direction, near)
        Relative gain toward directions about the boresight [dB].
    """

    beam: Integers
    gain: NDArray[np.float32]

    @classmethod
    def of(cls, azimuth: Real, elevation: Real, antenna: Antenna) -> "Neighbours":
        """Neighbours in a scan; computed once for equal scans."""
        return _neighbours(tuple(azimuth.tolist()), tuple(elevation.tolist()), antenna)


@lru_cache(maxsize=4)
def _neighbours(azimuth: tuple[float, ...], elevation: tuple[float, ...], antenna: Antenna) -> Neighbours:
    directions = beam_directions(azimuth, elevation)
    width = np.array([antenna.hpbw_azimuth or 360.0, antenna.hpbw_elevation or 180.0])
    away = directions[None] - directions[:, None]
    away[..., 0] = wrap(away[..., 0])
    distance = np.max(np.abs(away) / width, axis=-1)
    count = max(int((distance <= REACH).sum(axis=1).max()), 1)
    beam = np.argsort(distance, axis=1, kind="stable")[:, :count]
    beam = np.where(np.take_along_axis(distance, beam, axis=1) <= REACH, beam, -1)
    pattern = Pattern.of(antenna)
    offset = np.linspace(-1, 1, STEPS)
    reach = np.array([width[0], width[1]])
    grid = np.stack(np.meshgrid(offset * reach[0], 1.5 * offset * reach[1], indexing="ij"), axis=-1).reshape(-1, 2)
    gain = np.empty((len(directions), len(grid), count), np.float32)
    for number, (toward, near) in enumerate(zip(directions[:, None] + grid[None], beam, strict=True)):
        gain[number] = beam_gains(toward[:, 0], toward[:, 1], directions[near], pattern)
    return Neighbours(beam, gain)


@dataclass(frozen=True)
class Paths:
    """Strong paths, and the power in the beams about each.

    Attributes
    ----------
    beam, delay : array (path,)
        Beam that sees the path best, and sample of its peak there.
    around : array (path, near)
        Numbers of the beams about it, itself first; -1 for none.
    seen : array (path, near)
        Power in these beams within two samples of the peak [dB over the noise].
    expected : array (path, near)
        What the beams together and the pattern predict [dB over the noise].
    unseen : array (path,)
        Power that a beam about the path's own lacks, in which the path must be seen from wherever in the main lobe of
        its own it comes [dB]; 0 if there is none, or if the path is consistent.
    consistent : array (path,)
        Whether one direction explains most beams, so that the prediction can be trusted.
    """

    beam: Integers
    delay: Integers
    around: Integers
    seen: Real
    expected: Real
    unseen: Real
    consistent: NDArray[np.bool_]

    def take(self, rows: Integers) -> "Paths":
        """Some of the paths."""
        return Paths(**{name: column[rows] for name, column in vars(self).items()})

    @property
    def clear(self) -> NDArray[np.bool_]:
        """Beams (path, near) in which the path is seen, or should be seen, well over the noise."""
        return (self.around >= 0) & (np.maximum(self.expected, self.seen) > CLEAR)

    @property
    def agree(self) -> NDArray[np.bool_]:
        """Beams (path, near) that see the path as expected."""
        return self.clear & (np.abs(self.seen - self.expected) < AGREEMENT)


def find_paths(snr: NDArray[np.floating], near: Neighbours) -> Paths:
    """Find the strong paths and fit a direction to the powers about each.

    The fit is robust: the level is the median over the beams of the main lobe, and no beam adds more than `LARGEST` to
    the misfit. One bad beam of the nine in a lobe does not change it.

    Parameters
    ----------
    snr : array (beam, delay)
        Power over the noise of the beam; 0 where nothing was recorded.
    near : Neighbours
    """
    beam, delay, around, seen = _strongest(snr, near)
    coarse = near.gain[beam]
    best, expected = _fit(seen, coarse, around)
    best, expected = _fit(seen, _between(coarse, best), around)
    paths = Paths(beam, delay, around, seen, expected, np.zeros(beam.size), np.zeros(beam.size, bool))
    agree, clear = paths.agree.sum(axis=1), paths.clear.sum(axis=1)
    paths.consistent[:] = (agree >= MIN_BEAMS) & (agree >= MIN_SHARE * clear)
    alone = np.flatnonzero(~paths.consistent)
    paths.unseen[alone] = _unseen(seen[alone].astype(np.float32), coarse[alone], around[alone])
    return paths


def _strongest(snr: NDArray[np.floating], near: Neighbours) -> tuple[Integers, Integers, Integers, Real]:
    """Peaks that no beam about theirs sees better: beam, delay, beams about it, and powers there [dB]."""
    beam, delay = np.nonzero(snr > MIN_SNR)
    size = snr.shape[1]
    value = snr[beam, delay]
    top = (value >= snr[beam, (delay + 1) % size]) & (value >= snr[beam, delay - 1])
    beam, delay, value = beam[top], delay[top], value[top]
    around = near.beam[beam]
    used: NDArray[np.bool_] = np.asarray(snr.any(axis=1))
    around = np.where(used[around], around, -1)
    around[near.beam[beam] < 0] = -1
    close = (delay[:, None] + np.arange(-2, 3)) % size
    window = np.where(around[..., None] >= 0, snr[around[..., None], close[:, None, :]], 0).max(axis=-1)
    order = np.flatnonzero(window[:, 0] >= window.max(axis=1, initial=0))
    order = order[np.argsort(-value[order], kind="stable")][:MAX_PATHS]
    seen = 10 * np.log10(np.maximum(window[order], NOTHING)).astype(float)
    return beam[order], delay[order], around[order], seen


def _fit(seen: Real, gain: NDArray[np.floating], around: Integers) -> tuple[Integers, Real]:
    """Best of the directions, and the powers (path, near) that it predicts [dB]."""
    have = (around >= 0)[:, None, :]
    lobe = (gain > MAIN_LOBE) & have
    level = np.sort(np.where(lobe, seen[:, None, :] - gain, np.inf), axis=-1)
    count = lobe.sum(axis=-1)
    middle = np.take_along_axis(level, np.maximum(count - 1, 0)[..., None] // 2, axis=-1)
    middle = np.where(count[..., None] > 1, middle, 0)  # one beam alone tells no direction
    expected = 10 * np.log10(10 ** ((middle + gain) / 10) + NOISE)
    clear = have & (np.maximum(expected, seen[:, None, :]) > CLEAR)
    misfit = np.where(clear, np.minimum(np.abs(seen[:, None, :] - expected), LARGEST), 0).sum(axis=-1)
    misfit = np.where(count > 1, misfit / np.maximum(clear.sum(axis=-1), 1), np.inf)
    best = misfit.argmin(axis=1)
    return best, expected[np.arange(best.size), best]


def _unseen(seen: NDArray[np.floating], gain: NDArray[np.floating], around: Integers) -> Real:
    """Power that beams about each path's own lack (path,) [dB]; 0 if some direction in its main lobe explains most.

    From whatever direction in its main lobe that its own beam sees best the path comes, most of the other beams that
    must see it do not.
    """
    gain = np.where((around >= 0)[:, None, :], gain, NOWHERE)
    own, others = gain[..., :1], gain[..., 1:]
    least, found = seen[:, None, :1] + others - own, seen[:, None, 1:]
    lacking = found < np.maximum(np.minimum(least - FADING, UNSEEN), least - MISSING)
    most = 2 * lacking.sum(axis=-1) > (lacking | (least > UNSEEN)).sum(axis=-1)
    inside = (own[..., 0] > MAIN_LOBE) & (own[..., 0] >= others.max(axis=-1, initial=NOWHERE))
    lack = np.where(lacking, least - found, 0).max(axis=-1, initial=0)
    lack = np.where(inside, np.where(most, lack, 0), np.inf).min(axis=1)
    return np.where(np.isfinite(lack), lack, 0.0)


def _between(gain: NDArray[np.floating], best: Integers) -> Real:
    """Gains toward directions about the best one, interpolated in dB: a Gaussian lobe is a parabola there."""
    paths, _, count = gain.shape
    grid = gain.reshape(paths, STEPS, STEPS, count)
    step = np.linspace(-1, 1, FINE)
    places = [np.clip(part, 1, STEPS - 2)[:, None] + step for part in np.divmod(best, STEPS)]
    low = [np.minimum(np.floor(place).astype(int), STEPS - 2) for place in places]
    i, j, path = low[0][:, :, None], low[1][:, None, :], np.arange(paths)[:, None, None]
    u, v = (places[0] - low[0])[:, :, None, None], (places[1] - low[1])[:, None, :, None]
    first = grid[path, i, j] * (1 - v) + grid[path, i, j + 1] * v
    second = grid[path, i + 1, j] * (1 - v) + grid[path, i + 1, j + 1] * v
    fine: Real = (first * (1 - u) + second * u).reshape(paths, FINE * FINE, count)
    return fine


def contradictions(paths: Paths, snr: NDArray[np.floating]) -> Real:
    """How far each beam (beam,) contradicts the others [dB]; 0 where it does not.

    A beam contradicts if a path about which more than `MIN_BEAMS` others agree is missing in it by `MISSING` or more
    (fewer agree by themselves), or if it sees a path that they do not see although the antenna's lobes overlap. It does
    not if it agrees about another path with `MIN_BEAMS` others. More power than expected is no contradiction: there may
    be a second path. A beam that lacks a path by `MISSING`, which nearly all see through their sidelobes, contradicts
    in any case.

    Parameters
    ----------
    paths : Paths
    snr : array (beam, delay)
        Power over the noise of the beam; 0 where nothing was recorded.
    """
    figure, agrees = np.zeros(len(snr)), np.zeros(len(snr), bool)
    sure = (paths.consistent & (paths.agree.sum(axis=1) > MIN_BEAMS))[:, None]
    agrees[paths.around[paths.agree & sure]] = True
    short = paths.expected - paths.seen
    missing = sure & (paths.around >= 0) & (paths.seen < UNSEEN) & (short > MISSING) & (paths.expected > EXPECTED)
    np.maximum.at(figure, paths.around[missing], short[missing])
    np.maximum.at(figure, paths.beam, paths.unseen)
    lack = lacking(paths, snr)
    return np.maximum(np.where(agrees, 0, figure), np.where(lack > MISSING, lack, 0))


def lacking(paths: Paths, snr: NDArray[np.floating]) -> Real:
    """What beams (beam,) lack of the strongest path, where nearly all others see it [dB]; 0 for beams that see it."""
    used = snr.any(axis=1)
    if not paths.delay.size or used.sum() < 4 * MIN_BEAMS:
        return np.zeros(len(snr))
    three = (paths.delay[0] + np.array([-1, 0, 1])) % snr.shape[1]
    level = 10 * np.log10(np.maximum(snr[:, three].max(axis=1), NOTHING))
    low, usual, high = np.quantile(level[used], [0.25, 0.5, 0.75])
    missing = used & (level < low - SPREAD * (high - low) - AGREEMENT) & (low > UNSEEN)
    return np.where(missing, usual - level, 0)


def shift_between(own: NDArray[np.floating], others: NDArray[np.floating]) -> int:
    """Delay of one beam's profile against that of the others [sample]; 0 if it is not certain.

    Parameters
    ----------
    own, others : array (delay,)
        Power over the noise in a beam, and the largest of the beams about it.
    """
    spectra = [np.fft.rfft(np.log(np.maximum(profile / PROFILE, 1))) for profile in (own, others)]
    cross = np.fft.irfft(spectra[0] * np.conj(spectra[1]), own.size)
    best = int(cross.argmax())
    elsewhere = np.roll(cross, -best)[APART:-APART]
    if cross[best] <= 0 or elsewhere.max() > UNIQUE * cross[best]:
        return 0
    return (best + own.size // 2) % own.size - own.size // 2
