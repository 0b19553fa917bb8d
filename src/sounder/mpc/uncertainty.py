"""What arrives together with a path and is not told from it, judged by what the fit left and what is beside it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sounder.cir.deembedding import Deembedding
from sounder.cir.matched_filter import OVERSAMPLING
from sounder.instrument.antenna_pattern import Pattern
from sounder.kernels.extraction import columns
from sounder.kernels.extraction.columns import NEAR
from sounder.mpc.cramer_rao import gains

BESIDE = 1.8, 5.4
"""From where to where other arrivals are looked for on either side of a path, in resolution cells: 1.7 to 5 ns."""
LOBE = 2.0
"""Resolution cells to which the main lobe of a pulse reaches; farther off it is sidelobes and no arrival."""

Real = NDArray[np.float64]
Integers = NDArray[np.int64]


class Seen(NamedTuple):
    """How the beams see the paths.

    Attributes
    ----------
    power : array (mpc, direction)
        The pattern's toward each path, relative to boresight; 0 where nothing was recorded.
    beam : array (mpc, near)
        The beams that see each path best, at most `component.NEAR`, best first.
    weight : array (mpc, near)
        Their powers, of sum 1: their share in what is known of the delay.
    """

    power: Real
    beam: Integers
    weight: Real


def widened(
    wider: Real, found: Real, left: NDArray[np.complex64] | None, noise: Real, seen: Seen, filter_: Deembedding
) -> Real:
    """Variances of delay and of magnitudes, over those that noise and the fit's own residual make.

    With ``v`` for the paths found, `scatter` ``q`` and `unresolved` power ``u`` over the noise ``N``, the delay's is
    ``v max(1, q) + u / N``, that of the magnitudes, whose fit has a residual ``m`` of its own, ``v + u / (N m)``.

    Parameters
    ----------
    wider : array (mpc, 2)
        ``v``, from :func:`sounder.mpc.overlap.widening`.
    found, left, noise, seen, filter_
        As for `unresolved`.

    Returns
    -------
    array (mpc, 2)
    """
    alone = noise[found[:, columns.BEAM].astype(int)]
    more = unresolved(found, left, noise, seen, filter_) / alone
    moved = np.ones(len(found)) if left is None else scatter(found, left, noise, seen, filter_)
    residual = np.fmax(1.0, found[:, columns.MISFIT])
    return np.stack([wider[:, 0] * np.fmax(1.0, moved) + more, wider[:, 1] + more / residual], axis=1)


def beams_seeing(found: Real, noise: Real, looks: tuple[Real, Real], pattern: Pattern) -> Seen:
    """How the beams see the paths found.

    Parameters
    ----------
    found : array (mpc, component.COLUMNS)
    noise : array (beam,)
        Noise power, NaN where nothing was recorded.
    looks : arrays (azimuth,), (elevation,)
        Directions of the scan [degree].
    pattern : Pattern
    """
    power = 10 ** (gains(found[:, columns.AZIMUTH], found[:, columns.ELEVATION], *looks, pattern) / 10)
    power[:, ~np.isfinite(noise)] = 0.0
    beam = np.argsort(-power, axis=1)[:, :NEAR]
    weight = np.take_along_axis(power, beam, axis=1)
    return Seen(power, beam, weight / weight.sum(axis=1, keepdims=True))


def scatter(found: Real, left: NDArray[np.complex64], noise: Real, seen: Seen, filter_: Deembedding) -> Real:
    """What the fits left where a shift of the delay would show, over what noise leaves there.

    With ``s`` the slope of the matched filter and ``r_b`` what is left of beam ``b``, a shift of the path in this beam
    shows in ``D_b = s^H r_b`` in phase with the path, and interference moves it as much in phase as in quadrature:
    ``sum_b w_b |D_b|^2 / (N_b s^H R s) / (1 - sum_b w_b^2 / 2)``, with ``R`` the correlation of the noise, is 1 for
    one path in noise; the last factor is for the one delay that was fitted.

    Parameters
    ----------
    found : array (mpc, component.COLUMNS)
    left : array (beam, delay)
        The CIRs without the paths found.
    noise : array (beam,)
        Noise power.
    seen : Seen
    filter_ : Deembedding

    Returns
    -------
    array (mpc,)
    """
    table = np.gradient(filter_.matched_filter.taps)
    middle = table.size // 2
    reach = middle // OVERSAMPLING - 1
    taps = np.arange(-reach, reach + 1)
    correlation = np.fft.ifft(filter_.noise)
    at_rest = table[middle + taps * OVERSAMPLING]
    power = np.einsum("i,ij,j->", at_rest, correlation[taps[:, None] - taps], at_rest.conj()).real
    shown = np.empty(len(found))
    for p, (beam, weight) in enumerate(zip(seen.beam, seen.weight, strict=True)):
        delay = found[p, columns.DELAY]
        samples = int(np.floor(delay + 0.5)) + taps
        slope = table[np.rint(middle + (samples - delay) * OVERSAMPLING).astype(int)]
        moved = np.abs(left[beam[:, None], samples % left.shape[1]] @ slope) ** 2
        shown[p] = np.sum(weight * np.where(weight > 0, moved / noise[beam], 0.0)) / (1 - np.sum(weight**2) / 2)
    return shown / power


def unresolved(
    found: Real,
    left: NDArray[np.complex64] | None,
    noise: Real,
    seen: Seen,
    filter_: Deembedding,
) -> Real:
    """Power that is to be expected within the pulse of each path besides its own.

    Where paths are dense, the fit gives one path what belongs to several within its pulse, and leaves nothing that
    would show it. How dense they are is seen on either side: the power from `BESIDE` before the path, of the paths
    found there and of what is left over the noise where that is more than the noise, and likewise after it. Their
    geometric mean is the density between them if it goes on evenly in decibels. One neighbour on one side, such as
    the ground's reflection after a direct path, is no density.

    Parameters
    ----------
    found : array (mpc, component.COLUMNS)
    left : array (beam, delay) or None
        The CIRs without the paths found; None where none were taken out.
    noise : array (beam,)
        Noise power.
    seen : Seen
    filter_ : Deembedding

    Returns
    -------
    array (mpc,)
        Mean over the beams by their weight, in the units of the noise power.
    """
    size = filter_.weight.size
    cell = 1 / np.ptp(np.fft.fftfreq(size)[filter_.weight > 0])
    nearest, farthest = (round(cells * cell) for cells in BESIDE)
    ring = np.arange(nearest, farthest + 1)
    pulse = np.abs(filter_.matched_filter.pulse) ** 2
    axis = (np.arange(pulse.size) - pulse.size // 2) / OVERSAMPLING
    pulse[np.abs(axis) > LOBE * cell] = 0.0
    power = seen.power * found[:, columns.AMPLITUDE, None] ** 2
    density = np.empty((len(found), 2))
    for p, (beam, weight) in enumerate(zip(seen.beam, seen.weight, strict=True)):
        late = (found[:, columns.DELAY] - found[p, columns.DELAY] + size / 2) % size - size / 2
        others = np.flatnonzero((np.abs(late) < farthest + LOBE * cell) & (np.arange(len(found)) != p))
        theirs = power[others][:, beam] @ weight
        own = weight @ np.where(weight > 0, noise[beam], 0.0)
        start = int(np.floor(found[p, columns.DELAY] + 0.5))
        for side, samples in enumerate((-ring, ring)):
            density[p, side] = theirs @ np.interp(samples - late[others, None], axis, pulse, 0, 0).mean(axis=1)
            if left is not None:
                around = np.abs(left[beam[:, None], (start + samples) % size]) ** 2
                rest = weight @ np.where(weight > 0, around.mean(axis=1), 0.0) - own
                density[p, side] += rest if rest > own else 0.0
    return np.sqrt(density[:, 0] * density[:, 1])
