"""Errors of a path beyond noise: other paths in the same beams within its pulse, resolved or not."""

import numpy as np
from numpy.typing import NDArray

from sounder.cir.matched_filter import OVERSAMPLING
from sounder.kernels.extraction.records import FIT_BEAMS, OVERLAP
from sounder.mpc.cramer_rao import Band
from sounder.mpc.scan import Scan

RING_START = 1.8
"""Other arrivals are looked for on either side of a path from this distance on [resolution cell]: 1.7 ns; chosen."""
RING_END = 5.4
"""And up to this distance [resolution cell]: 5 ns; chosen."""
MAIN_LOBE = 2.0
"""How far the main lobe of a pulse reaches; farther off it is sidelobes and no arrival [resolution cell]."""

Real = NDArray[np.float64]
Integers = NDArray[np.int64]
Paths = NDArray[np.record]
Residual = NDArray[np.complex64] | None


def beam_power(found: Paths, scan: Scan, departure: Paths | None = None) -> Real:
    """Power pattern (mpc, link) of the links toward the paths, relative to boresight; 0 in links not recorded.

    It is the product of the patterns at both ends. Without ``departure`` the transmit antenna is taken to have one
    beam.
    """
    power = 10 ** (scan.gains(found["azimuth"], found["elevation"]) / 10)
    if departure is not None and scan.departure.size > 1:
        other = 10 ** (scan.departure.gains(departure["azimuth"], departure["elevation"]) / 10)
        power = (other[:, :, None] * power[:, None, :]).reshape(len(found), -1)
    power[:, ~np.isfinite(scan.noise)] = 0.0
    return power


def best_beams(power: Real) -> tuple[Integers, Real]:
    """The beams (mpc, near) that see each path best, and their share (mpc, near) in what is known of its delay.

    Parameters
    ----------
    power : array (mpc, beam)
        From `beam_power`.
    """
    beam = np.argsort(-power, axis=1)[:, :FIT_BEAMS]
    weight = np.take_along_axis(power, beam, axis=1)
    return beam, weight / weight.sum(axis=1, keepdims=True)


def variance_inflation(found: Paths, power: Real, group: Integers, residual: Residual, scan: Scan) -> Real:
    """Variances of delay and of magnitudes, over those that noise and the fit's own residual make.

    With `overlap_inflation` ``v`` for the paths found, `scatter` ``q`` and `unresolved_power` ``u`` over the noise
    ``N``, that of the delay is ``v max(1, q) + u / N``, that of the magnitudes, whose fit counts the power ``m N`` as
    noise (its residual, or the error of the pattern), ``v + u / (N m)``. The delays of a group are fitted with the
    magnitudes, and ``q`` is of the residual that cancellation left before that: ``v + u / (N m)``.

    Parameters
    ----------
    found : array of `sounder.kernels.extraction.records.PATH` (mpc,)
    power : array (mpc, beam)
        From `beam_power`.
    group : array (mpc,)
        Number of the group that was fitted together, -1 for others.
    residual : array complex (beam, delay) or None
        The CIRs without the paths found; None where none were removed.
    scan : Scan

    Returns
    -------
    array (mpc, 2)
    """
    noise = scan.noise[found["beam"]]
    inflation = overlap_inflation(found, power, group, scan)
    excess = unresolved_power(found, power, residual, scan) / noise
    scattered = np.ones(len(found)) if residual is None else scatter(found, power, residual, scan)
    counted = np.fmax(1.0, found["misfit"])
    of_delay = np.where(group >= 0, counted, 1.0)
    scattered[group >= 0] = 1.0
    delay = inflation[:, 0] * np.fmax(1.0, scattered) + excess / of_delay
    return np.stack([delay, inflation[:, 1] + excess / counted], axis=1)


def overlap_inflation(found: Paths, power: Real, group: Integers, scan: Scan) -> Real:
    """Variances of delay and of magnitudes beside the other paths found, over those of the path alone.

    In direction ``b`` a path has the spectrum ``a p``, of unit energy ``p``, and a neighbour ``q`` of unknown phase is
    interference of power ``r_qb`` and shape ``s_q``. With ``S = [p, s_1, ...]`` and ``L_b = diag(0, 1/r_1b, ...)``,

    ``var(a_b) = [(S^H S + L_b)^-1]_00``,  ``1 / var(delay) = sum_b g_b^2 p'^H (I - S (S^H S + L_b)^-1 S^H) p'``,

    for the amplitude of the path itself is unknown too. ``p'`` is the derivative by delay. The errors of the
    neighbours' delays are left out.

    Parameters
    ----------
    found, power, group, scan
        As for `variance_inflation`. Paths of one group are not counted: their errors hold each other already.

    Returns
    -------
    array (mpc, 2)
        At least 1, of delay and of magnitudes.

    References
    ----------
    Scharf, Statistical Signal Processing, 1991, section 6.5.
    """
    inflation = np.ones((len(found), 2))
    late = scan.delay_after(found["delay"][None, :], found["delay"][:, None])
    close = np.abs(late) < OVERLAP
    close &= (group[:, None] != group[None, :]) | (group < 0) | np.eye(len(found), dtype=bool)
    if close.sum() == len(found):
        return inflation
    strongest_snr = (scan.pattern_margin * found["amplitude"]) ** 2 / scan.noise[found["beam"]]
    band = Band.of(scan.filter_)
    frequency = 2 * np.pi * band.frequency / scan.filter_.sample_rate
    spectrum = np.sqrt(band.density / band.density.sum())
    frequency, spectrum = frequency[spectrum > 0], spectrum[spectrum > 0]
    for p, (beams, weight) in enumerate(zip(*best_beams(power), strict=True)):
        others = np.flatnonzero(close[p] & (np.arange(len(found)) != p))
        if not others.size:
            continue
        shapes = spectrum * np.exp(-1j * np.outer(np.append(0.0, late[p, others]), frequency))
        slope = -1j * frequency * shapes[0]
        prior = np.zeros((beams.size, others.size + 1))
        snr = strongest_snr[others] * power[others][:, beams].T * band.density.sum()
        prior[:, 1:] = 1 / np.maximum(snr, 1e-12)
        covariance = np.linalg.inv((shapes.conj() @ shapes.T)[None] + prior[:, :, None] * np.eye(others.size + 1))
        inner = shapes.conj() @ slope
        full = np.vdot(slope, slope).real
        information = full - np.einsum("i,bij,j->b", inner.conj(), covariance, inner).real
        inflation[p, 0] = (full - abs(inner[0]) ** 2) / (weight @ information)
        inflation[p, 1] = 1 / (weight @ (1 / covariance[:, 0, 0].real))
    return inflation


def scatter(found: Paths, power: Real, residual: NDArray[np.complex64], scan: Scan) -> Real:
    """Power of the residuals where a shift of the delay would show, over that of the noise there.

    With ``s`` the slope of the matched filter and ``r_b`` the residual of beam ``b``, a shift of the path in this beam
    shows in ``D_b = s^H r_b`` in phase with the path. Interference contributes as much in phase as in quadrature:
    ``sum_b w_b |D_b|^2 / (N_b s^H R s) / (1 - sum_b w_b^2 / 2)``, with ``R`` the correlation of the noise, is 1 for
    one path in noise. The last factor is for the one delay that was fitted.

    Parameters
    ----------
    found, power, residual, scan
        As for `variance_inflation`.

    Returns
    -------
    array (mpc,)
    """
    slope_table = np.gradient(scan.filter_.matched_filter.taps)
    middle = slope_table.size // 2
    reach = middle // OVERSAMPLING - 1
    taps = np.arange(-reach, reach + 1)
    correlation = np.fft.ifft(scan.filter_.noise)
    centred = slope_table[middle + taps * OVERSAMPLING]
    expected = np.einsum("i,ij,j->", centred, correlation[taps[:, None] - taps], centred.conj()).real
    scattered = np.empty(len(found))
    for p, (beam, weight) in enumerate(zip(*best_beams(power), strict=True)):
        delay = found["delay"][p]
        samples = int(np.floor(delay + 0.5)) + taps
        slope = slope_table[np.rint(middle + (samples - delay) * OVERSAMPLING).astype(int)]
        shift = np.abs(residual[beam[:, None], samples % scan.period] @ slope) ** 2
        mean = np.sum(weight * np.where(weight > 0, shift / scan.noise[beam], 0.0))
        scattered[p] = mean / (1 - np.sum(weight**2) / 2)
    return scattered / expected


def unresolved_power(found: Paths, power: Real, residual: Residual, scan: Scan) -> Real:
    """Power of paths that were not resolved, to be expected within the pulse of each path found.

    Where paths are dense, the fit gives one path the power of several within its pulse, and no residual shows it. The
    density is taken from either side: the power from `RING_START` to `RING_END` before the path, of the paths found
    there and of the residual where that exceeds the noise, and likewise after it. Their geometric mean is the density
    between them if it continues evenly in decibels. One neighbour on one side, such as the ground reflection after a
    direct path, is no density.

    Scattering of a path's own begins with the path, and nothing is before it. It follows all paths of a position alike:
    after each it has a share of the path's power, for which the median over the position stands, with 0 of one path
    more. The less of that and of what is after this path is its tail, which fills half of the pulse; a neighbour that
    the others do not have is none. The larger of the two densities counts.

    Parameters
    ----------
    found, power, residual, scan
        As for `variance_inflation`.

    Returns
    -------
    array (mpc,)
        Mean over the beams by their weight, in the units of the noise power.
    """
    ring = np.arange(round(RING_START * scan.resolution), round(RING_END * scan.resolution) + 1)
    pulse = np.abs(scan.filter_.matched_filter.pulse) ** 2
    lag = (np.arange(pulse.size) - pulse.size // 2) / OVERSAMPLING
    pulse[np.abs(lag) > MAIN_LOBE * scan.resolution] = 0.0
    received = power * found["amplitude"][:, None] ** 2
    density, own = np.empty((len(found), 2)), np.empty(len(found))
    for p, (beam, weight) in enumerate(zip(*best_beams(power), strict=True)):
        delay, own[p] = found["delay"][p], received[p, beam] @ weight
        late = scan.delay_after(found["delay"], delay)
        near = np.abs(late) < ring[-1] + MAIN_LOBE * scan.resolution
        others = np.flatnonzero(near & (np.arange(len(found)) != p))
        theirs = received[others][:, beam] @ weight
        noise = weight @ np.where(weight > 0, scan.noise[beam], 0.0)
        start = int(np.floor(delay + 0.5))
        for side, samples in enumerate((-ring, ring)):
            density[p, side] = theirs @ np.interp(samples - late[others, None], lag, pulse, 0, 0).mean(axis=1)
            if residual is not None:
                around = np.abs(residual[beam[:, None], (start + samples) % scan.period]) ** 2
                excess = weight @ np.where(weight > 0, around.mean(axis=1), 0.0) - noise
                density[p, side] += excess if excess > noise else 0.0
    before, after = density.T
    share = np.quantile(np.append(after / own, 0.0), 0.5, method="lower")
    return np.maximum(np.sqrt(before * after), np.minimum(after, share * own) / 2)
