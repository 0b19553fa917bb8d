"""Delays of one path in overlapping beams."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sounder.quality.beams import AGREEMENT, MAIN_LOBE, Neighbours, Paths

Real = NDArray[np.float64]
Integers = NDArray[np.int64]

WINDOW = 5
"""Samples to either side of a path's peak in which other beams are searched for it."""
SEEN = 30.0
"""Power over the noise of a peak whose delay is used: 15 dB."""
CLOSE = 2
"""The same for single directions that slipped, which is rarely by more than a sample."""
SIDELOBES = 6.0
"""Difference from the usual power in sidelobes beyond which a beam sees something else [dB]: they are known to 6 dB."""
UNRESOLVED = 0.2
"""Error of the delay of a path beside weak ones that are not resolved [sample]: of one 14 dB below, a sample off."""
SIGMAS = 3.0
"""Standard errors that a delay may be off."""
FAR_SEEN = 8
"""Strongest paths whose delays are measured in all beams; chosen."""


@dataclass(frozen=True)
class Delays:
    """Delays of paths in beams.

    Attributes
    ----------
    path, beam : array (delay,)
        Numbers of the path and of the beam.
    delay : array (delay,)
        Against the peak in the path's strongest beam [sample].
    tolerance : array (delay,)
        Error that noise and other paths make [sample].
    far : array (delay,)
        Whether the beam is far from the path and sees it through its sidelobes.
    sample : array (delay,)
        Sample of the peak in the path's strongest beam.
    """

    path: Integers
    beam: Integers
    delay: Real
    tolerance: Real
    far: NDArray[np.bool_]
    sample: Integers

    @property
    def off(self) -> Real:
        """Delays (delay,) against the median over the beams of their path."""
        middle = np.zeros(int(self.path.max(initial=-1)) + 1)
        for number in np.unique(self.path):
            middle[number] = np.median(self.delay[self.path == number])
        against: Real = self.delay - middle[self.path]
        return against


def measure_delays(snr: NDArray[np.floating], paths: Paths, near: Neighbours, window: int, *, strict: bool) -> Delays:
    """Delays of the highest peaks about every path's, by a parabola through three samples in dB.

    A Hann-shaped spectrum has a pulse that is a parabola in dB about its peak, to 0.02 samples. With the power
    ``A exp(-k t^2)`` over a noise of the same band, its delay has the variance ``1 / (2 A k)``.

    Parameters
    ----------
    snr : array (beam, delay)
        Power over the noise of the beam.
    paths : Paths
    near : Neighbours
    window : int
        Samples to either side of the peak in which it is searched for.
    strict : bool
        Of the beams about a path, use only those that see it as strong as expected.
    """
    size = snr.shape[1]
    paths = _without_sidelobes(paths, size)
    lag = np.arange(-window - 1, window + 2)
    at = (paths.delay[:, None] + lag) % size
    around, used = paths.around, paths.around >= 0
    if strict:
        used &= paths.agree & paths.consistent[:, None]
    around, used = _with_far_beams(paths, near, used, snr.shape)
    power = snr[np.maximum(around, 0)[..., None], at[:, None, :]]
    inner = power[..., 1:-1]
    peak = inner.argmax(axis=-1) + 1
    left, middle, right = (
        np.log(np.maximum(np.take_along_axis(power, (peak + step)[..., None], axis=-1)[..., 0], 1e-6))
        for step in (-1, 0, 1)
    )
    curvature = left - 2 * middle + right
    is_peak = (middle > left) & (middle >= right) & (middle > np.log(SEEN)) & used
    far = np.arange(around.shape[1]) >= paths.around.shape[1]
    usual = np.ma.median(np.ma.masked_array(middle, ~(is_peak & far)), axis=1).filled(0.0)[:, None]
    is_peak &= ~far | (np.abs(middle - usual) < SIDELOBES * np.log(10) / 10)
    delay = lag[peak] + 0.5 * (left - right) / np.where(curvature < 0, curvature, -1)
    path, beam = np.nonzero(is_peak)
    std = 1 / np.sqrt(np.exp(middle[path, beam]) * -curvature[path, beam])
    tolerance = UNRESOLVED + SIGMAS * std
    late = delay[path, beam].astype(float)
    return Delays(path, around[path, beam], late, tolerance.astype(float), far[beam], paths.delay[path])


def _without_sidelobes(paths: Paths, size: int) -> Paths:
    """Paths but for those at the delay of a stronger one that are weak enough to be its sidelobes."""
    level = paths.seen[:, 0]
    apart = np.abs(paths.delay[:, None] - paths.delay)
    same = (np.minimum(apart, size - apart) <= CLOSE) & (level[:, None] < level + MAIN_LOBE)
    return paths.take(np.flatnonzero(~same.any(axis=1)))


def _with_far_beams(
    paths: Paths, near: Neighbours, used: NDArray[np.bool_], shape: tuple[int, ...]
) -> tuple[Integers, NDArray[np.bool_]]:
    """Beams of each path, and for the strongest paths all other beams, which see them through their sidelobes.

    Of paths that are close in delay, sidelobes show the strongest, but not in beams about those that see more than it:
    there is another path.
    """
    beams, size = shape
    apart = np.abs(paths.delay[:, None] - paths.delay)
    close = np.minimum(apart, size - apart) < 2 * WINDOW
    shown = np.flatnonzero(~np.tril(close, -1).any(axis=1))[:FAR_SEEN]
    lobe = np.zeros((len(paths.around), beams + 1), bool)
    np.put_along_axis(lobe, paths.around, True, axis=1)
    for path, beam in np.argwhere(_more_than_expected(paths)):
        lobe[path, near.beam[paths.around[path, beam]]] = True
    seen = np.zeros((len(lobe), beams), bool)
    seen[shown] = ~lobe[shown, :beams]
    return np.hstack([paths.around, np.tile(np.arange(beams), (len(lobe), 1))]), np.hstack([used, seen])


def _more_than_expected(paths: Paths) -> NDArray[np.bool_]:
    """Beams (path, near) about a consistent path that see more than it."""
    return paths.consistent[:, None] & paths.clear & (paths.seen > paths.expected + AGREEMENT)
