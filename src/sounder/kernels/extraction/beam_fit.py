"""Sub-beam angle of a path, from its amplitudes in neighbouring beams and the antenna's pattern."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from sounder.kernels.compiler.compile import part
from sounder.kernels.extraction.records import Path
from sounder.kernels.extraction.scan_view import AntennaView, pattern, toward

Real = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

MIN_DECREASE = 1e-6
"""A fit ends when a step would decrease the cost by less than this share: a thousandth of a standard deviation."""
ROUNDING = 1e-14
"""Cost, relative to the power, that is rounding alone."""
EXCESS = 2.0
"""Standard deviations by which residuals must exceed the noise before they are used as variance. The larger of two
estimates of one variance is too large on average."""


class NormalEquations(NamedTuple):
    """Amplitude, cost and normal equations of the angles at some angles.

    Attributes
    ----------
    amplitude : float
    cost : float
        Squared residuals.
    power : float
        Sum of the squared magnitudes.
    energy : float
        Sum of the squared pattern.
    aa, ae, ee : float
        Normal matrix of azimuth and elevation.
    gradient_a, gradient_e : float
        Right side.
    mean_a, mean_e : float
        Products of the pattern with its derivatives, times the amplitude.
    """

    amplitude: float
    cost: float
    power: float
    energy: float
    aa: float
    ae: float
    ee: float
    gradient_a: float
    gradient_e: float
    mean_a: float
    mean_e: float


@part
def fit_angles(
    antenna: AntennaView,
    magnitude: Real,
    near: Integers,
    noise: float,
    bounds: tuple[float, float, float, float],
    free: tuple[float, float],
    max_steps: float,
    path: Path,
) -> float:
    """Fit ``magnitude[i] = a g_i(azimuth, elevation)`` by least squares (Levenberg-Marquardt).

    The amplitude is linear and eliminated: ``a = g.m / g.g``, and the derivatives of ``a g`` by the angles are
    projected orthogonal to ``g`` (Kaufman's variable projection [1]_). The variances are those of the full problem.

    Parameters
    ----------
    antenna : AntennaView
    magnitude : array (n,)
        Amplitudes of the path, without their phases: those drift from one direction to the next.
    near : array (n,)
        Their beams; the arrays may be longer, ``near`` ends with -1.
    noise : float
        Variance of a magnitude.
    bounds : tuple of 4 floats
        Lowest and highest azimuth, lowest and highest elevation [degree].
    free : tuple of 2 floats
        1 for an angle to be fitted; one with 0 stays at its start.
    max_steps : float
        A literal int would have this compiled for every number.
    path : record of `PATH`
        Holds the first azimuth and elevation; filled with angles, amplitude, their variances and covariances, and
        the misfit (NaN without residuals or noise).

    Returns
    -------
    float
        Sum of squared residuals.

    References
    ----------
    .. [1] L. Kaufman, "A variable projection method for solving separable nonlinear least squares problems",
       BIT 15, 1975.
    """
    azimuth, elevation = path.azimuth, path.elevation
    best = _normal_equations(antenna, magnitude, near, azimuth, elevation, free)
    damping = 1e-3
    for _ in range(int(max_steps)):
        aa, ee = best.aa * (1.0 + damping), best.ee * (1.0 + damping)
        determinant = aa * ee - best.ae * best.ae
        if determinant <= 0.0:
            break
        step_a = (ee * best.gradient_a - best.ae * best.gradient_e) / determinant
        step_e = (aa * best.gradient_e - best.ae * best.gradient_a) / determinant
        small = step_a * best.gradient_a + step_e * best.gradient_e < MIN_DECREASE * best.cost
        if small or best.cost < ROUNDING * best.power:
            break
        new_azimuth = _within(azimuth + free[0] * step_a, bounds[0], bounds[1])
        new_elevation = _within(elevation + free[1] * step_e, bounds[2], bounds[3])
        if new_azimuth == azimuth and new_elevation == elevation:
            break  # held by a bound
        trial = _normal_equations(antenna, magnitude, near, new_azimuth, new_elevation, free)
        if trial.cost < best.cost:
            azimuth, elevation, best = new_azimuth, new_elevation, trial
            damping *= 0.1
        else:
            damping *= 10.0
    count = 0
    while count < near.size and near[count] >= 0:
        count += 1
    freedom = count - 1.0 - free[0] - free[1]
    variance = noise
    if freedom > 0.0 and best.cost - freedom * noise > EXCESS * math.sqrt(2.0 * freedom) * noise:
        variance = best.cost / freedom
    path.misfit = best.cost / (freedom * noise) if freedom > 0.0 and noise > 0.0 else math.nan
    path.azimuth, path.elevation, path.amplitude = azimuth, elevation, best.amplitude
    _set_covariance(path, best, variance, free)
    return best.cost


@part
def _set_covariance(path: Path, best: NormalEquations, variance: float, free: tuple[float, float]) -> None:
    """Write variances and covariances, for magnitudes of a variance."""
    path.azimuth_variance = path.elevation_variance = math.inf
    path.amplitude_variance = path.azimuth_elevation = path.azimuth_amplitude = path.elevation_amplitude = 0.0
    # An angle that no beam depends on to first order (all at the floor, or symmetric) is not determined.
    least = 1e-9 * best.amplitude * best.amplitude * best.energy
    determinant = best.aa * best.ee - best.ae * best.ae
    if determinant > 0.0:
        aa, ee, ae = best.ee / determinant, best.aa / determinant, -best.ae / determinant
        # The amplitude's error is the noise's less what the errors of the angles take away.
        by_a = (best.mean_a * aa + best.mean_e * ae) / best.energy
        by_e = (best.mean_a * ae + best.mean_e * ee) / best.energy
        path.amplitude_variance = variance * (best.mean_a * by_a + best.mean_e * by_e) / best.energy
        if best.aa > least:
            path.azimuth_variance, path.azimuth_amplitude = variance * aa, -variance * by_a
        if best.ee > least:
            path.elevation_variance, path.elevation_amplitude = variance * ee, -variance * by_e
        if best.aa > least and best.ee > least:
            path.azimuth_elevation = variance * ae
    path.amplitude_variance += variance / best.energy
    if free[0] == 0.0:
        path.azimuth_variance = math.nan
    if free[1] == 0.0:
        path.elevation_variance = math.nan


@part
def _within(x: float, low: float, high: float) -> float:
    if x < low:
        return low
    return high if x > high else x


@part
def _normal_equations(
    antenna: AntennaView,
    magnitude: Real,
    near: Integers,
    azimuth: float,
    elevation: float,
    free: tuple[float, float],
) -> NormalEquations:
    """Fit the amplitude alone, and make the normal equations of the angles."""
    direction = toward(azimuth, elevation)
    inner = energy = by_a = by_e = aa = ae = ee = power = gradient_a = gradient_e = 0.0
    for i in range(near.size):
        if near[i] < 0:
            break
        m = magnitude[i]
        g, slope_a, slope_e = pattern(antenna, near[i], direction)
        slope_a, slope_e = free[0] * slope_a, free[1] * slope_e
        power += m * m
        inner += g * m
        energy += g * g
        by_a += g * slope_a
        by_e += g * slope_e
        aa += slope_a * slope_a
        ae += slope_a * slope_e
        ee += slope_e * slope_e
        gradient_a += m * slope_a
        gradient_e += m * slope_e
    a = inner / energy
    # Residuals r = m - a g are orthogonal to g, so that projecting the slopes changes no product with r.
    return NormalEquations(
        a,
        power - a * inner,
        power,
        energy,
        a * a * (aa - by_a * by_a / energy) + (1.0 - free[0]),
        a * a * (ae - by_a * by_e / energy),
        a * a * (ee - by_e * by_e / energy) + (1.0 - free[1]),
        a * (gradient_a - a * by_a),
        a * (gradient_e - a * by_e),
        a * by_a,
        a * by_e,
    )
