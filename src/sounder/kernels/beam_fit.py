"""Sub-beam angle of a path, from its amplitudes in neighbouring beams and the antenna's pattern."""

import numpy as np
import numpy.typing as npt

from sounder.kernels.compile import part

Real = npt.NDArray[np.float64]

ITERATIONS = 12
NUDGE = 0.05
"""Step of the pattern's numerical derivative [degree]; the tables are 0.25 degree apart."""


@part
def cut_at(cut: Real, angle: float) -> float:
    """Value [dB] of a cut tabulated evenly from -180 to 180 degree."""
    place = (angle + 180.0) * (cut.size - 1) / 360.0
    left = min(max(int(place), 0), cut.size - 2)
    part_ = place - left
    return cut[left] * (1 - part_) + cut[left + 1] * part_


@part
def beam_amplitude(
    azimuth: float,
    elevation: float,
    look_azimuth: float,
    look_elevation: float,
    azimuth_cut: Real,
    elevation_cut: Real,
    floor: float,
) -> float:
    """Amplitude of the pattern toward a direction, relative to boresight; angles in degree.

    The plain-numpy twin is :meth:`sounder.antenna.Pattern.beam_gain`.
    """
    turn = np.radians(azimuth - look_azimuth)
    up = np.radians(elevation)
    tilt = np.radians(look_elevation)
    x = np.cos(up) * np.cos(turn) * np.cos(tilt) + np.sin(up) * np.sin(tilt)
    y = np.cos(up) * np.sin(turn)
    z = np.sin(up) * np.cos(tilt) - np.cos(up) * np.cos(turn) * np.sin(tilt)
    off_azimuth = np.degrees(np.arctan2(y, x))
    off_elevation = np.degrees(np.arcsin(min(max(z, -1.0), 1.0)))
    gain = max(cut_at(azimuth_cut, off_azimuth) + cut_at(elevation_cut, off_elevation), floor)
    return 10.0 ** (gain / 20.0)


@part
def fit_angles(
    magnitude: Real,
    looks: Real,
    start: Real,
    lower: Real,
    upper: Real,
    free: npt.NDArray[np.bool_],
    noise: float,
    azimuth_cut: Real,
    elevation_cut: Real,
    floor: float,
    result: Real,
) -> float:
    """Fit ``magnitude[b] = a g_b(azimuth, elevation)`` by least squares (Levenberg-Marquardt).

    Parameters
    ----------
    magnitude : array (beam,)
        Amplitudes of the path, without their phases: those drift from one direction to the next.
    looks : array (beam, 2)
        Azimuth and elevation of each beam [degree].
    start, lower, upper : array (2,)
        First guess and bounds [degree].
    free : array (2,)
        Which angles to fit; the other stays at its start.
    noise : float
        Variance of a magnitude.
    azimuth_cut, elevation_cut, floor
        The pattern [dB].
    result : array (6,)
        Filled with azimuth, elevation [degree], a, and their standard deviations.

    Returns
    -------
    float
        Sum of squared residuals.
    """
    beams = magnitude.size
    angles = start.copy()
    g = np.empty(beams)
    slope = np.zeros((beams, 3))
    damping = 1e-3
    best = np.inf
    amplitude = 0.0
    trial = start.copy()
    normal = np.zeros((3, 3))
    for iteration in range(ITERATIONS):
        inner = 0.0
        energy = 0.0
        for b in range(beams):
            g[b] = beam_amplitude(trial[0], trial[1], looks[b, 0], looks[b, 1], azimuth_cut, elevation_cut, floor)
            inner += g[b] * magnitude[b]
            energy += g[b] ** 2
        a = inner / energy
        cost = 0.0
        for b in range(beams):
            cost += (magnitude[b] - a * g[b]) ** 2
        if cost < best or iteration == 0:
            converged = best - cost < 1e-9 * best
            best, amplitude = cost, a
            angles[:] = trial
            damping *= 0.3
            if converged and iteration > 0:
                break
            _slopes(angles, amplitude, looks, free, azimuth_cut, elevation_cut, floor, slope)
            for i in range(3):
                for j in range(3):
                    normal[i, j] = 0.0
                    for b in range(beams):
                        normal[i, j] += slope[b, i] * slope[b, j]
        else:
            damping *= 10.0
        gradient = np.zeros(3)
        for b in range(beams):
            g_here = slope[b, 2]
            for i in range(3):
                gradient[i] += slope[b, i] * (magnitude[b] - amplitude * g_here)
        step = _solve(normal, gradient, damping)
        for i in range(2):
            trial[i] = min(max(angles[i] + step[i], lower[i]), upper[i])
    variance = max(noise, best / max(beams - 1 - free[0] - free[1], 1))
    for i in range(3):
        unit = np.zeros(3)
        unit[i] = 1.0
        # An angle that no beam depends on to first order (all at the floor, or symmetric) is not determined.
        flat = normal[i, i] < 1e-9 * amplitude**2
        result[3 + i] = np.inf if flat else np.sqrt(max(variance * _solve(normal, unit, 1e-12)[i], 0.0))
        if i < 2 and not free[i]:
            result[3 + i] = np.nan
    result[0], result[1], result[2] = angles[0], angles[1], amplitude
    return best


@part
def _slopes(
    angles: Real,
    amplitude: float,
    looks: Real,
    free: npt.NDArray[np.bool_],
    azimuth_cut: Real,
    elevation_cut: Real,
    floor: float,
    slope: Real,
) -> None:
    """Derivatives of the model by azimuth, elevation and amplitude, shape (beam, 3)."""
    for b in range(looks.shape[0]):
        for i in range(2):
            slope[b, i] = 0.0
            if free[i]:
                nudge_a = NUDGE if i == 0 else 0.0
                nudge_e = NUDGE if i == 1 else 0.0
                after = beam_amplitude(
                    angles[0] + nudge_a,
                    angles[1] + nudge_e,
                    looks[b, 0],
                    looks[b, 1],
                    azimuth_cut,
                    elevation_cut,
                    floor,
                )
                before = beam_amplitude(
                    angles[0] - nudge_a,
                    angles[1] - nudge_e,
                    looks[b, 0],
                    looks[b, 1],
                    azimuth_cut,
                    elevation_cut,
                    floor,
                )
                slope[b, i] = amplitude * (after - before) / (2 * NUDGE)
        slope[b, 2] = beam_amplitude(angles[0], angles[1], looks[b, 0], looks[b, 1], azimuth_cut, elevation_cut, floor)


@part
def _solve(normal: Real, right: Real, damping: float) -> Real:
    """Solve the damped 3 x 3 normal equations; a parameter without influence stays."""
    m = np.zeros((3, 4))
    for i in range(3):
        for j in range(3):
            m[i, j] = normal[i, j]
        m[i, i] *= 1.0 + damping
        if m[i, i] <= 0.0:
            m[i, i] = 1.0
        m[i, 3] = right[i]
    for i in range(3):  # positive definite: elimination needs no pivoting
        for row in range(3):
            if row != i and m[i, i] != 0.0:
                factor = m[row, i] / m[i, i]
                for j in range(4):
                    m[row, j] -= factor * m[i, j]
    out = np.zeros(3)
    for i in range(3):
        out[i] = m[i, 3] / m[i, i] if m[i, i] != 0.0 else 0.0
    return out
