"""Successive cancellation: find the strongest path, fit it, take it out of every beam, and look again.

A path of amplitude ``a`` from direction ``w`` at delay ``d`` appears in every beam ``b`` as ``a g(w - w_b) p(t - d)``
with a phase of its own, since the phase drifts while the horn turns. Each beam's complex amplitude is therefore
fitted anew, and trusted as long as its magnitude is no more than ``margin`` times what the pattern allows: so a
stronger path's sidelobes, in angle and in delay, go with it, and another path that arrives at the same time stays.

The search keeps the maximum of each block of delays, so one round costs what one path touches.
"""

import numpy as np
import numpy.typing as npt

from sounder.kernels.beam_fit import beam_amplitude, fit_angles
from sounder.kernels.compile import jit, part
from sounder.kernels.pulse import FIT_REACH, add_pulse, amplitude_at, fit_delay, pulse_at

Real = npt.NDArray[np.float64]
Beams = npt.NDArray[np.complex64]

BLOCK = 32
"""Delays in a block of the search."""
TOGETHER = 3
"""Rounds of fitting paths again that share samples with a new one."""

(
    DELAY,
    AZIMUTH,
    ELEVATION,
    AMPLITUDE,
    AZIMUTH_STD,
    ELEVATION_STD,
    AMPLITUDE_STD,
    LEFT_OVER,
    BEAM,
    OFF_BORESIGHT,
) = range(10)
"""Columns of the result; the last are the power that the fit left around the peak, the beam it was found in, and the
pattern's amplitude from that beam toward it."""
COLUMNS = 10
CLEARLY = 0.25
"""Residual power, relative to that of a fit from the beam's own direction, at which a fit from outside the fan wins."""
SURELY = 1.0
"""By how much, in units of the noise power over the pattern's amplitude out there, it must be smaller besides. Just
above the fan 2 to 4 noise powers suffice, 2 to 3 standard deviations of the magnitudes; far out, where a path would
have to be 20 dB stronger than it looks, 10."""


@jit
def cancel(
    beams: Beams,
    threshold: Real,
    noise: Real,
    looks: Real,
    grid: npt.NDArray[np.int64],
    limits: Real,
    azimuth_cut: Real,
    elevation_cut: Real,
    pattern_floor: float,
    table: npt.NDArray[np.complex128],
    over: int,
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
    threshold, noise : array (beam,)
        Least power of a path, and mean power of the noise.
    looks : array (beam, 2)
        Where each beam looks [degree].
    grid : array (3,)
        Number of azimuths and elevations, and whether the azimuths close a circle.
    limits : array (4,)
        How far from its beam a path may be fitted in azimuth; lowest and highest elevation; half-power beamwidth in
        elevation [degree].
    azimuth_cut, elevation_cut, pattern_floor
        The pattern [dB]; see :mod:`sounder.kernels.beam_fit`.
    table, over
        The pulse; see :mod:`sounder.kernels.pulse`.
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
        _fit(
            beams,
            b,
            float(k),
            noise,
            looks,
            grid,
            limits,
            azimuth_cut,
            elevation_cut,
            pattern_floor,
            table,
            over,
            found[count],
        )
        _take(
            beams,
            noise,
            looks,
            azimuth_cut,
            elevation_cut,
            pattern_floor,
            table,
            over,
            margin,
            found[count],
            taken[count],
        )
        found[count, LEFT_OVER] = _power_around(beams[b], found[count, DELAY])
        _mark(ghost, looks, azimuth_cut, elevation_cut, pattern_floor, table, over, leftover, found[count])
        ghost[b, k] = np.inf
        if _within_another(found, count, resolution, n_delays):
            taken[count] = 0
            _update(beams, ghost, threshold, peak, found[count, DELAY], table, over)
            continue
        count += 1
        # A path whose pulse holds another's is fitted wrong, and what is left of both looks like more paths: fit such
        # groups again at once, before their remainders are searched.
        for _ in range(TOGETHER):
            for i in range(count):
                if _share(found[i], found[count - 1], 3 * limits[0], n_delays):
                    _fit_again(
                        beams,
                        noise,
                        looks,
                        grid,
                        limits,
                        azimuth_cut,
                        elevation_cut,
                        pattern_floor,
                        table,
                        over,
                        margin,
                        found[i],
                        taken[i],
                    )
        for i in range(count):
            if _share(found[i], found[count - 1], 3 * limits[0], n_delays):
                _update(beams, ghost, threshold, peak, found[i, DELAY], table, over)
    complete = bool(np.max(peak) <= 0.0)
    for _ in range(passes):
        for i in range(count):
            _fit_again(
                beams,
                noise,
                looks,
                grid,
                limits,
                azimuth_cut,
                elevation_cut,
                pattern_floor,
                table,
                over,
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
def _fit(
    beams: Beams,
    b: int,
    start: float,
    noise: Real,
    looks: Real,
    grid: npt.NDArray[np.int64],
    limits: Real,
    azimuth_cut: Real,
    elevation_cut: Real,
    pattern_floor: float,
    table: npt.NDArray[np.complex128],
    over: int,
    row: Real,
) -> None:
    """Delay from the strongest beam, then angles and amplitude from it and its neighbours."""
    delay = fit_delay(beams[b], table, over, start)
    n_azimuths, n_elevations = grid[0], grid[1]
    a, e = b // n_elevations, b % n_elevations
    magnitude = np.empty(9)
    near = np.empty((9, 2))
    beam_count = 0
    free = np.zeros(2, np.bool_)
    for da in range(-1, 2):
        for de in range(-1, 2):
            na, ne = a + da, e + de
            if grid[2]:
                na = na % n_azimuths
            if na < 0 or na >= n_azimuths or ne < 0 or ne >= n_elevations:
                continue
            if n_azimuths < 3 and da == 1 and grid[2]:
                continue  # the same beam as da == -1
            other = na * n_elevations + ne
            if not np.isfinite(noise[other]):
                continue
            power = abs(amplitude_at(beams[other], table, over, delay)) ** 2 - 0.5 * noise[other]
            magnitude[beam_count] = np.sqrt(max(power, 0.0))
            near[beam_count] = looks[other]
            beam_count += 1
            free[0] |= da != 0
            free[1] |= de != 0
    start_angles = looks[b].copy()
    lower = np.array([looks[b, 0] - limits[0], limits[1]])
    upper = np.array([looks[b, 0] + limits[0], limits[2]])
    result = np.empty(6)
    best = inside = np.inf
    # Beyond the edge of the fan the pattern's floor makes further minima: start from several angles, the beam's own
    # first, and that one kept within half its power. One further out must fit clearly and surely better: neither
    # interference nor noise must turn a weak path into a strong one out there.
    outward = 1 if e == n_elevations - 1 else -1
    starts = 10 if free[1] and (e == n_elevations - 1 or e == 0) else 1
    edge = looks[b, 1] + 0.5 * outward * limits[3]
    for start_ in range(starts):
        tilt, turn = (start_ + 2) // 3, start_ % 3 - 1 if start_ else 0
        start_angles[0] = looks[b, 0] + 0.4 * turn * limits[0]
        start_angles[1] = min(max(looks[b, 1] + 0.5 * outward * tilt * limits[3], limits[1]), limits[2])
        within_fan = start_ == 0 and starts > 1
        lower[1] = edge if within_fan and outward < 0 else limits[1]
        upper[1] = edge if within_fan and outward > 0 else limits[2]
        cost = fit_angles(
            magnitude[:beam_count],
            near[:beam_count],
            start_angles,
            lower,
            upper,
            free,
            0.5 * noise[b],
            azimuth_cut,
            elevation_cut,
            pattern_floor,
            result,
        )
        near_fan = start_ == 0 or outward * (result[1] - edge) <= 0.0
        if near_fan:
            inside = min(inside, cost)
        seen = beam_amplitude(result[0], result[1], looks[b, 0], looks[b, 1], azimuth_cut, elevation_cut, pattern_floor)
        if cost < best and (near_fan or (cost < CLEARLY * inside and cost < inside - SURELY * noise[b] / seen)):
            best = cost
            row[AZIMUTH : AMPLITUDE_STD + 1] = result
    row[DELAY] = delay
    row[BEAM] = b
    row[OFF_BORESIGHT] = beam_amplitude(
        row[AZIMUTH], row[ELEVATION], looks[b, 0], looks[b, 1], azimuth_cut, elevation_cut, pattern_floor
    )


@part
def _take(
    beams: Beams,
    noise: Real,
    looks: Real,
    azimuth_cut: Real,
    elevation_cut: Real,
    pattern_floor: float,
    table: npt.NDArray[np.complex128],
    over: int,
    margin: float,
    row: Real,
    taken: Beams,
) -> None:
    """Take a path out of every beam in which the pattern lets it stand above a tenth of the noise."""
    for b in range(beams.shape[0]):
        taken[b] = 0
        if not np.isfinite(noise[b]):
            continue
        g = beam_amplitude(
            row[AZIMUTH], row[ELEVATION], looks[b, 0], looks[b, 1], azimuth_cut, elevation_cut, pattern_floor
        )
        predicted = row[AMPLITUDE] * g
        if predicted**2 < 0.1 * noise[b] and b != int(row[BEAM]):
            continue
        amplitude = amplitude_at(beams[b], table, over, row[DELAY])
        size = abs(amplitude)
        if size > margin * predicted and b != int(row[BEAM]):
            amplitude *= predicted / size
        taken[b] = amplitude
        add_pulse(beams[b], table, over, row[DELAY], -amplitude)


@part
def _give_back(beams: Beams, table: npt.NDArray[np.complex128], over: int, row: Real, taken: Beams) -> None:
    for b in range(beams.shape[0]):
        if taken[b] != 0:
            add_pulse(beams[b], table, over, row[DELAY], taken[b])


@part
def _fit_again(
    beams: Beams,
    noise: Real,
    looks: Real,
    grid: npt.NDArray[np.int64],
    limits: Real,
    azimuth_cut: Real,
    elevation_cut: Real,
    pattern_floor: float,
    table: npt.NDArray[np.complex128],
    over: int,
    margin: float,
    row: Real,
    taken: Beams,
) -> None:
    """Put a path back and fit it to what the others left."""
    _give_back(beams, table, over, row, taken)
    b = int(row[BEAM])
    _fit(beams, b, row[DELAY], noise, looks, grid, limits, azimuth_cut, elevation_cut, pattern_floor, table, over, row)
    _take(beams, noise, looks, azimuth_cut, elevation_cut, pattern_floor, table, over, margin, row, taken)
    row[LEFT_OVER] = _power_around(beams[b], row[DELAY])


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
    looks: Real,
    azimuth_cut: Real,
    elevation_cut: Real,
    pattern_floor: float,
    table: npt.NDArray[np.complex128],
    over: int,
    leftover: Real,
    row: Real,
) -> None:
    """Raise the level under which a peak is a remainder of this path."""
    reach = (table.size - 1) // (2 * over)
    centre = round(row[DELAY])
    size = ghost.shape[1]
    for b in range(ghost.shape[0]):
        g = beam_amplitude(
            row[AZIMUTH], row[ELEVATION], looks[b, 0], looks[b, 1], azimuth_cut, elevation_cut, pattern_floor
        )
        level = (row[AMPLITUDE] * max(leftover[0] * g, leftover[1] * min(g, leftover[2]))) ** 2
        for k in range(centre - reach, centre + reach + 1):
            # A remainder is shaped as the pulse or its derivative, so as wide as the pulse and a sample on either side.
            shape = 0.0
            for aside in range(-1, 2):
                shape = max(shape, abs(pulse_at(table, over, k - row[DELAY] + aside)) ** 2)
            ghost[b, k % size] = max(ghost[b, k % size], level * shape)


@part
def _update(
    beams: Beams,
    ghost: npt.NDArray[np.float32],
    threshold: Real,
    peak: Real,
    delay: float,
    table: npt.NDArray[np.complex128],
    over: int,
) -> None:
    """Search again the blocks that a path reached."""
    reach = (table.size - 1) // (2 * over)
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
def _power_around(row: Beams, delay: float) -> float:
    """Mean power within two samples of a delay."""
    centre = round(delay)
    total = 0.0
    for k in range(centre - 2, centre + 3):
        value = row[k % row.size]
        total += value.real**2 + value.imag**2
    return total / 5


@part
def _within_another(found: Real, count: int, resolution: Real, period: int) -> bool:
    for i in range(count):
        late = _apart(found[i, DELAY], found[count, DELAY], period)
        turn = abs((found[i, AZIMUTH] - found[count, AZIMUTH] + 180.0) % 360.0 - 180.0)
        tilt = abs(found[i, ELEVATION] - found[count, ELEVATION])
        if late < resolution[0] and turn < resolution[1] and tilt < resolution[2]:
            return True
    return False
