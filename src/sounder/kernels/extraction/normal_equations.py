"""Normal equations of several paths in the samples of many beams."""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from sounder.kernels.compiler.compile import jit, part
from sounder.kernels.extraction.scan_view import pattern, toward

Real = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Records = npt.NDArray[np.record]

KINDS = 5
"""Parameters of a path: azimuth, elevation, logarithm of the amplitude, delay, phase."""


class BeamView(NamedTuple):
    """Attributes of `sounder.kernels.extraction.scan_view.AntennaView` that its `pattern` needs."""

    beams: Records
    azimuth_cut: Real
    elevation_cut: Real
    floor: float


@part
def inner(first: Complex, second: Complex) -> complex:
    """Inner product, the first conjugated."""
    total = 0j
    for k in range(first.size):
        total += np.conj(first[k]) * second[k]
    return total


@jit
def add_normal_equations(
    paths: Real,
    view: Any,
    pulse: Complex,
    slope: Complex,
    samples: Complex,
    noise: Real,
    cost: Real,
    normal: Real,
    gradient: Real,
) -> None:
    """Cost and normal equations of the model of :mod:`sounder.mpc.several_paths`, for several sets of paths.

    A derivative of the model of a beam is a number times the pulse of a path, or times the pulse's slope. So all sums
    over samples are inner products of pulses, the same for all beams, and of pulses with the samples of the beam.

    Parameters
    ----------
    paths : array (set, path, 5)
    view : BeamView
    pulse, slope : array complex (set, path, combination)
        At the delays of the paths: whitened pulses of amplitude 1, and their derivatives by delay.
    samples : array complex (beam, combination)
        Whitened.
    noise : array (beam,)
    cost, normal, gradient : array (set,), (set, parameter, parameter), (set, parameter)
        Zeros, to which is added. The parameters are the five of each path in turn.
    """
    count = paths.shape[1]
    size = KINDS * count
    waves = np.empty((2 * count, pulse.shape[2]), np.complex128)  # pulses of the paths, then slopes
    products = np.empty((2 * count, 2 * count), np.complex128)
    received = np.empty(2 * count, np.complex128)
    gain = np.empty(count)
    factor = np.empty(size, np.complex128)  # derivatives, as multiples of waves
    wave = np.empty(size, np.int64)
    share = np.empty(size)
    for p in range(count):
        for kind in range(KINDS):
            wave[KINDS * p + kind] = p + count if kind == 3 else p
    for s in range(paths.shape[0]):
        for p in range(count):
            amplitude = math.exp(paths[s, p, 2]) * complex(math.cos(paths[s, p, 4]), math.sin(paths[s, p, 4]))
            for k in range(pulse.shape[2]):
                waves[p, k] = amplitude * pulse[s, p, k]
                waves[count + p, k] = amplitude * slope[s, p, k]
        for i in range(2 * count):
            for j in range(2 * count):
                products[i, j] = inner(waves[i], waves[j])
        for b in range(noise.size):
            level = 1 / math.sqrt(noise[b])
            for i in range(2 * count):
                received[i] = inner(waves[i], samples[b])
            seen = 0j
            for p in range(count):
                g, by_azimuth, by_elevation = pattern(view, b, toward(paths[s, p, 0], paths[s, p, 1]))
                gain[p] = level * g
                first = KINDS * p
                factor[first], factor[first + 1] = level * by_azimuth, level * by_elevation
                factor[first + 2], factor[first + 3], factor[first + 4] = gain[p], gain[p], gain[p] * 1j
                seen += gain[p] * received[p]
            energy = 0.0
            for p in range(count):
                for q in range(count):
                    energy += gain[p] * gain[q] * products[p, q].real
            magnitude = abs(seen)
            u = math.sqrt(4 * magnitude**2 + 2.25)
            ratio = 2 * magnitude / (0.5 + u)
            cost[s] += energy - u + 0.5 * math.log(0.5 + u)
            turned = ratio * np.conj(seen) / max(magnitude, 1e-300)
            weight = min(math.sqrt(2.0) * ratio, 1.0) ** 2
            for i in range(size):
                with_model = 0j
                for p in range(count):
                    with_model += gain[p] * products[p, wave[i]]
                with_model *= factor[i]
                # the phase of the direction absorbs its share of what a parameter changes
                share[i] = with_model.imag / max(energy, 1e-300)
                gradient[s, i] += (turned * np.conj(factor[i]) * received[wave[i]] - with_model).real
            for i in range(size):
                for j in range(i + 1):
                    product = (np.conj(factor[i]) * factor[j] * products[wave[i], wave[j]]).real
                    normal[s, i, j] += weight * (product - share[i] * share[j] * energy)
        for i in range(size):
            for j in range(i):
                normal[s, j, i] = normal[s, i, j]
