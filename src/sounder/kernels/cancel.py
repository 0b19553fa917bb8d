"""Successive cancellation: find the strongest path, fit it, take it out of every beam, and look again.

A path of amplitude ``a`` from direction ``w`` at delay ``d`` appears in every beam ``b`` as ``a g(w - w_b) p(t - d)``
with a phase of its own, since the phase drifts while the horn turns. Each beam's complex amplitude is therefore
fitted anew, and trusted as long as its magnitude is no more than ``margin`` times what the pattern allows: so a
stronger path's sidelobes, in angle and in delay, go with it, and another path that arrives at the same time stays.

The search keeps the maximum of each block of delays, so one round costs what one path touches.
"""

import numpy as np
import numpy.typing as npt

from sounder.kernels.compile import jit, part
from sounder.kernels.path import (
    AMPLITUDE,
    AZIMUTH,
    BEAM,
    DELAY,
    ELEVATION,
    LEFT_OVER,
    OFF_BORESIGHT,
    Beams,
    Real,
    View,
    fit,
    fit_again,
    power_around,
    take,
    toward,
)
from sounder.kernels.pulse import FIT_REACH, pulse_at

BLOCK = 32
"""Delays in a block of the search."""
TOGETHER = 3
"""Rounds of fitting paths again that share samples with a new one."""


@jit
def cancel(
    beams: Beams,
    threshold: Real,
    view: View,
    resolution: Real,
    margin: float,
    leftover: Real,
    passes: int,
    found: Real,
) -> tuple[int, bool]:
    """Extract paths from the CIRs of all beams; ``beams`` holds what is left.

    Parameters
    ----------
    beams : array (beam, delay)
        CIRs, azimuth-major; NaN rows are beams that were not recorded.
    threshold : array (beam,)
        Least power of a path.
    view : View
        What the beams see a path with.
    resolution : array (3,)
        Delay [sample], azimuth and elevation [degree] within which two paths are one.
    margin : float
        How far the amplitude in a beam may exceed what the pattern predicts and still be that path's.
    leftover : array (3,)
        Amplitude under which what remains at a path's delay is its own remainder: relative to the path in that beam;
        and relative to the pattern in a beam's sidelobes, or to the third, the highest sidelobe, in its main lobe.
    passes : int
        Rounds of fitting all paths again, each against the others' remainder.
    found : array (capacity, COLUMNS)
        Filled with the paths.

    Returns
    -------
    count : int
        Number of paths.
    complete : bool
        False where peaks were left when ``found`` was full.
    """
    n_beams, n_delays = beams.shape
    n_blocks = (n_delays + BLOCK - 1) // BLOCK
    ghost = np.zeros((n_beams, n_delays), np.float32)
    peak = np.zeros((n_beams, n_blocks))
    for b in range(n_beams):
        for block in range(n_blocks):
            peak[b, block] = _block_peak(beams[b], ghost[b], threshold[b], block)
    taken = np.zeros((found.shape[0], n_beams), np.complex64)
    count = 0
    for _ in range(4 * found.shape[0]):  # every round takes at least one peak away
        if count == found.shape[0]:
            break
        at = int(np.argmax(peak))
        b, block = at // n_blocks, at % n_blocks
        if peak[b, block] <= 0.0:
            break
        k = _peak_delay(beams[b], ghost[b], threshold[b], block)
        fit(
            beams,
            b,
            float(k),
            view,
            found[count],
        )
        take(
            beams,
            view,
            margin,
            found[count],
            taken[count],
        )
        found[count, LEFT_OVER] = power_around(beams[b], found[count, DELAY])
        _mark(ghost, view, leftover, found[count])
        ghost[b, k] = np.inf
        if _within_another(found, count, resolution, n_delays):
            taken[count] = 0
            _update(beams, ghost, threshold, peak, found[count, DELAY], view)
            continue
        count += 1
        # A path whose pulse holds another's is fitted wrong, and what is left of both looks like more paths: fit such
        # groups again at once, before their remainders are searched.
        for _ in range(TOGETHER):
            for i in range(count):
                if _share(found[i], found[count - 1], 3 * view.limits[0], n_delays):
                    fit_again(
                        beams,
                        view,
                        margin,
                        found[i],
                        taken[i],
                    )
        for i in range(count):
            if _share(found[i], found[count - 1], 3 * view.limits[0], n_delays):
                _update(beams, ghost, threshold, peak, found[i, DELAY], view)
    complete = bool(np.max(peak) <= 0.0)
    for _ in range(passes):
        for i in range(count):
            fit_again(
                beams,
                view,
                margin,
                found[i],
                taken[i],
            )
    return _keep(found, count, threshold), complete


@part
def _keep(found: Real, count: int, threshold: Real) -> int:
    """Move the paths that still exceed the threshold to the front; fitted again, some turn out to be others' parts."""
    kept = 0
    for i in range(count):
        power = (found[i, AMPLITUDE] * found[i, OFF_BORESIGHT]) ** 2
        if power > threshold[int(found[i, BEAM])]:
            found[kept] = found[i]
            kept += 1
    return kept


@part
def _block_peak(row: Beams, ghost: npt.NDArray[np.float32], threshold: float, block: int) -> float:
    best = 0.0
    for k in range(block * BLOCK, min((block + 1) * BLOCK, row.size)):
        power = row[k].real ** 2 + row[k].imag ** 2
        if power > threshold and power > ghost[k] and power > best:
            best = power
    return best


@part
def _peak_delay(row: Beams, ghost: npt.NDArray[np.float32], threshold: float, block: int) -> int:
    best, where = 0.0, block * BLOCK
    for k in range(block * BLOCK, min((block + 1) * BLOCK, row.size)):
        power = row[k].real ** 2 + row[k].imag ** 2
        if power > threshold and power > ghost[k] and power > best:
            best, where = power, k
    return where


@part
def _share(row: Real, other: Real, azimuth: float, period: int) -> bool:
    """Tell whether two paths are fitted to samples that both are in."""
    turn = abs((row[AZIMUTH] - other[AZIMUTH] + 180.0) % 360.0 - 180.0)
    return _apart(row[DELAY], other[DELAY], period) < 2 * FIT_REACH and turn < azimuth


@part
def _apart(delay: float, other: float, period: int) -> float:
    """Distance of two delays on the circle [sample]."""
    late = abs(delay - other)
    return min(late, period - late)


@part
def _mark(
    ghost: npt.NDArray[np.float32],
    view: View,
    leftover: Real,
    row: Real,
) -> None:
    """Raise the level under which a peak is a remainder of this path."""
    reach = (view.table.size - 1) // (2 * view.over)
    centre = round(row[DELAY])
    size = ghost.shape[1]
    for b in range(ghost.shape[0]):
        g = toward(view, row[AZIMUTH], row[ELEVATION], b)
        level = (row[AMPLITUDE] * max(leftover[0] * g, leftover[1] * min(g, leftover[2]))) ** 2
        for k in range(centre - reach, centre + reach + 1):
            # A remainder is shaped as the pulse or its derivative, so as wide as the pulse and a sample on either side.
            shape = 0.0
            for aside in range(-1, 2):
                shape = max(shape, abs(pulse_at(view.table, view.over, k - row[DELAY] + aside)) ** 2)
            ghost[b, k % size] = max(ghost[b, k % size], level * shape)


@part
def _update(
    beams: Beams,
    ghost: npt.NDArray[np.float32],
    threshold: Real,
    peak: Real,
    delay: float,
    view: View,
) -> None:
    """Search again the blocks that a path reached."""
    reach = (view.table.size - 1) // (2 * view.over)
    n_delays = beams.shape[1]
    n_blocks = peak.shape[1]
    centre = round(delay)
    first = centre - reach
    last = centre + reach
    for step in range(n_blocks):
        begin = step * BLOCK
        end = min(begin + BLOCK, n_delays)
        for turn in (-n_delays, 0, n_delays):
            if begin + turn <= last and end + turn > first:
                for b in range(beams.shape[0]):
                    peak[b, step] = _block_peak(beams[b], ghost[b], threshold[b], step)
                break


@part
def _within_another(found: Real, count: int, resolution: Real, period: int) -> bool:
    for i in range(count):
        late = _apart(found[i, DELAY], found[count, DELAY], period)
        turn = abs((found[i, AZIMUTH] - found[count, AZIMUTH] + 180.0) % 360.0 - 180.0)
        tilt = abs(found[i, ELEVATION] - found[count, ELEVATION])
        if late < resolution[0] and turn < resolution[1] and tilt < resolution[2]:
            return True
    return False
