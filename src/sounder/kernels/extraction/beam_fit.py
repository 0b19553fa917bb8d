"""Sub-beam angle of a path, from its amplitudes in neighbouring beams and the antenna's pattern."""

import math

import numpy as np
import numpy.typing as npt

from sounder.kernels.compiler.compile import part
from sounder.kernels.extraction.scan_view import View, aim, pattern

Real = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

GAIN = 1e-6
"""Share of the cost under which what a step would gain, a thousandth of a deviation, is not worth it."""
EXACT = 1e-14
"""Cost, relative to the power, that is rounding alone."""
CHANCE = 2.0
"""Deviations by which residuals must exceed the noise's before they are believed: the larger of two estimates of one
variance is too large on average."""
COST, SUM_G2, NORMAL_AA, NORMAL_AE, NORMAL_EE, DOWN_A, DOWN_E, MEAN_A, MEAN_E, POWER = range(10)
SUMS = 10
"""Places of `_model`'s sums, and how many there are."""
AZIMUTH, ELEVATION, AMPLITUDE = range(3)
VAR_AZIMUTH, VAR_ELEVATION, VAR_AMPLITUDE, AZIMUTH_ELEVATION, AZIMUTH_AMPLITUDE, ELEVATION_AMPLITUDE = range(3, 9)
MISFIT = 9
"""Places of the result."""
RESULTS = 10


@part
def fit_angles(
    view: View,
    magnitude: Real,
    near: Integers,
    noise: float,
    bounds: Real,
    free: Real,
    steps: float,
    direction: Real,
    slopes: Real,
    sums: Real,
    fit: Real,
) -> float:
    """Fit ``magnitude[i] = a g_i(azimuth, elevation)`` by least squares (Levenberg-Marquardt).

    The amplitude is linear and eliminated: ``a = g.m / g.g``, and the derivatives of ``a g`` by the angles are taken
    at right angles to ``g`` (Kaufman's variable projection [1]_). The deviations are those of the full problem.

    Parameters
    ----------
    magnitude : array (n,)
        Amplitudes of the path, without their phases: those drift from one direction to the next.
    near : array (n,)
        Their beams; the arrays may be longer, ``near`` ends with -1.
    noise : float
        Variance of a magnitude.
    bounds : array (4,)
        Lowest and highest azimuth, lowest and highest elevation [degree].
    free : array (2,)
        1 for an angle to be fitted; one with 0 stays at its start.
    steps : float
        Most steps; a literal int would have this compiled for every number.
    direction, slopes, sums : array (4,), (2,), (SUMS,)
        Scratch.
    fit : array (RESULTS,)
        Holds the first azimuth and elevation [degree]; filled with azimuth, elevation, a, their variances and
        covariances, and the variance of the residuals over that of the noise (NaN without residuals or noise).

    Returns
    -------
    float
        Sum of squared residuals.

    References
    ----------
    .. [1] L. Kaufman, "A variable projection method for solving separable nonlinear least squares problems",
       BIT 15, 1975.
    """
    azimuth, elevation = fit[AZIMUTH], fit[ELEVATION]
    amplitude = _model(view, magnitude, near, azimuth, elevation, free, direction, slopes, sums)
    cost = sums[COST]
    normal_aa, normal_ae, normal_ee = sums[NORMAL_AA], sums[NORMAL_AE], sums[NORMAL_EE]
    down_a, down_e = sums[DOWN_A], sums[DOWN_E]
    energy, mean_a, mean_e = sums[SUM_G2], sums[MEAN_A], sums[MEAN_E]
    damping = 1e-3
    for _ in range(int(steps)):
        aa, ee = normal_aa * (1.0 + damping), normal_ee * (1.0 + damping)
        determinant = aa * ee - normal_ae * normal_ae
        if determinant <= 0.0:
            break
        step_a = (ee * down_a - normal_ae * down_e) / determinant
        step_e = (aa * down_e - normal_ae * down_a) / determinant
        if step_a * down_a + step_e * down_e < GAIN * cost or cost < EXACT * sums[POWER]:
            break
        new_azimuth = _within(azimuth + free[0] * step_a, bounds[0], bounds[1])
        new_elevation = _within(elevation + free[1] * step_e, bounds[2], bounds[3])
        new_amplitude = _model(view, magnitude, near, new_azimuth, new_elevation, free, direction, slopes, sums)
        if new_azimuth == azimuth and new_elevation == elevation:
            break  # held by a bound
        if sums[COST] < cost:
            azimuth, elevation, amplitude, cost = new_azimuth, new_elevation, new_amplitude, sums[COST]
            normal_aa, normal_ae, normal_ee = sums[NORMAL_AA], sums[NORMAL_AE], sums[NORMAL_EE]
            down_a, down_e = sums[DOWN_A], sums[DOWN_E]
            energy, mean_a, mean_e = sums[SUM_G2], sums[MEAN_A], sums[MEAN_E]
            damping *= 0.1
        else:
            damping *= 10.0
    count = 0
    while count < near.size and near[count] >= 0:
        count += 1
    left = count - 1.0 - free[0] - free[1]
    variance = noise
    if left > 0.0 and cost - left * noise > CHANCE * math.sqrt(2.0 * left) * noise:
        variance = cost / left
    fit[MISFIT] = cost / (left * noise) if left > 0.0 and noise > 0.0 else math.nan
    fit[AZIMUTH], fit[ELEVATION], fit[AMPLITUDE] = azimuth, elevation, amplitude
    for place in range(VAR_AZIMUTH, MISFIT):
        fit[place] = 0.0
    fit[VAR_AZIMUTH] = fit[VAR_ELEVATION] = math.inf
    # An angle that no beam depends on to first order (all at the floor, or symmetric) is not determined.
    least = 1e-9 * amplitude * amplitude * energy
    determinant = normal_aa * normal_ee - normal_ae * normal_ae
    if determinant > 0.0:
        aa, ee, ae = normal_ee / determinant, normal_aa / determinant, -normal_ae / determinant
        # The amplitude's error is the noise's less what the errors of the angles take away.
        by_a, by_e = (mean_a * aa + mean_e * ae) / energy, (mean_a * ae + mean_e * ee) / energy
        fit[VAR_AMPLITUDE] = variance * (mean_a * by_a + mean_e * by_e) / energy
        if normal_aa > least:
            fit[VAR_AZIMUTH], fit[AZIMUTH_AMPLITUDE] = variance * aa, -variance * by_a
        if normal_ee > least:
            fit[VAR_ELEVATION], fit[ELEVATION_AMPLITUDE] = variance * ee, -variance * by_e
        if normal_aa > least and normal_ee > least:
            fit[AZIMUTH_ELEVATION] = variance * ae
    fit[VAR_AMPLITUDE] += variance / energy
    if free[0] == 0.0:
        fit[VAR_AZIMUTH] = math.nan
    if free[1] == 0.0:
        fit[VAR_ELEVATION] = math.nan
    return cost


@part
def _within(x: float, low: float, high: float) -> float:
    if x < low:
        return low
    return high if x > high else x


@part
def _model(
    view: View,
    magnitude: Real,
    near: Integers,
    azimuth: float,
    elevation: float,
    free: Real,
    direction: Real,
    slopes: Real,
    sums: Real,
) -> float:
    """Fit the amplitude alone; fill ``sums`` with the cost and the normal equations of the angles."""
    aim(azimuth, elevation, direction)
    inner = energy = by_a = by_e = aa = ae = ee = size2 = down_a = down_e = 0.0
    for i in range(near.size):
        if near[i] < 0:
            break
        m = magnitude[i]
        g = pattern(view, direction, near[i], slopes)
        slope_a, slope_e = free[0] * slopes[0], free[1] * slopes[1]
        size2 += m * m
        inner += g * m
        energy += g * g
        by_a += g * slope_a
        by_e += g * slope_e
        aa += slope_a * slope_a
        ae += slope_a * slope_e
        ee += slope_e * slope_e
        down_a += m * slope_a
        down_e += m * slope_e
    a = inner / energy
    # Residuals r = m - a g are at right angles to g, so that projecting the slopes changes no product with r.
    sums[COST] = size2 - a * inner
    sums[POWER] = size2
    sums[SUM_G2] = energy
    sums[NORMAL_AA] = a * a * (aa - by_a * by_a / energy) + (1.0 - free[0])
    sums[NORMAL_AE] = a * a * (ae - by_a * by_e / energy)
    sums[NORMAL_EE] = a * a * (ee - by_e * by_e / energy) + (1.0 - free[1])
    sums[DOWN_A] = a * (down_a - a * by_a)
    sums[DOWN_E] = a * (down_e - a * by_e)
    sums[MEAN_A], sums[MEAN_E] = a * by_a, a * by_e
    return a
