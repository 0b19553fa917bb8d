"""Phases of captures by maximum likelihood, and their weighted sums, straight from the samples.

No capture is correlated: with the circular correlation ``C`` with the held template of ``N`` chips, the inner product
of two correlations is one of samples, ``(C m)^H (C x) = m^H C^H C x``, and ``C^H C`` is the circular convolution with
the autocorrelation of the template, a triangle of ``2 spc - 1`` samples on a constant floor:

    F m = C^H C m / (spc (N + 1)) = triangle * m - sum(m) / (N + 1),   triangle(l) = 1 - |l| / spc.

So a reference ``m`` is filtered once, and the phase of each capture costs one pass over its samples. The offset of the
receiver drops out, as it does from a correlation. `sounder.kernels.correlation.reference.align` is the readable twin.
"""

from typing import Any, NamedTuple

import numpy as np

from sounder.kernels.compiler.compile import jit, part, part_in_any_order
from sounder.kernels.correlation.tables import aligned_zeros

Array = Any

SETTLED = 1e-3
"""Mean square step of the phases [rad**2] after which they stand: the power of the mean falls short of its maximum by
less than this share."""
PASSES = 3
"""Passes over the captures at most, after the first. Each divides the error of the phases by one plus the SNR of the
mean, a sample; where three do not suffice, there is no more than noise."""
ENERGIES = 16
"""Captures of a block whose energy is measured: the energy of one, of N chips or more in noise, is known to 1/sqrt(N).
"""


class Work(NamedTuple):
    """Work space of one thread, float32, in numbers of a capture, flat I/Q.

    Attributes
    ----------
    planes : array (2, number)
        Filtered reference, laid out for `project`.
    parts : array (2, number)
        Sums of captures times the real and times the imaginary parts of their weights.
    before : array (number,)
        Aligned sum of the captures before a block.
    total : array (number,)
        The same, of the block too.
    """

    planes: Array
    parts: Array
    before: Array
    total: Array


def new_work(numbers: int) -> Work:
    """Allocate a work space, all zeros."""
    pair = (2, numbers)
    return Work(
        aligned_zeros(2 * numbers, np.float32).reshape(pair),
        aligned_zeros(2 * numbers, np.float32).reshape(pair),
        aligned_zeros(numbers, np.float32),
        aligned_zeros(numbers, np.float32),
    )


@part
def conjugate_planes(sum_: Array, spc: int, planes: Array) -> None:
    """Filter a sum, flat I/Q, by ``F`` and lay it out for `project`: rows for the real and the imaginary part."""
    numbers = sum_.size
    chips = numbers // (2 * spc)
    mean = np.zeros(2)
    for t in range(0, numbers, 2):
        mean[0] += sum_[t]
        mean[1] += sum_[t + 1]
    floor_i, floor_q = np.float32(mean[0] / (chips + 1)), np.float32(mean[1] / (chips + 1))
    for t in range(0, numbers, 2):
        planes[0, t] = sum_[t] - floor_i
        planes[0, t + 1] = sum_[t + 1] - floor_q
    for lag in range(1, spc):
        share, shift = np.float32(1 - lag / spc), 2 * lag
        for t in range(shift, numbers - shift):
            planes[0, t] += share * (sum_[t - shift] + sum_[t + shift])
        for t in range(shift):
            planes[0, t] += share * (sum_[t - shift + numbers] + sum_[t + shift])
            end = numbers - shift + t
            planes[0, end] += share * (sum_[end - shift] + sum_[t])
    for t in range(0, numbers, 2):
        planes[1, t] = -planes[0, t + 1]
        planes[1, t + 1] = planes[0, t]


@part_in_any_order
def project(x: Array, first: int, end: int, planes: Array, products: Array) -> None:
    """Inner products of captures with a reference, real and imaginary part; of four at a time, to load it once."""
    k = first
    while k + 4 <= end:
        p, q, r, s = x[k], x[k + 1], x[k + 2], x[k + 3]
        p_real, q_real, r_real, s_real = np.float32(0), np.float32(0), np.float32(0), np.float32(0)
        p_imag, q_imag, r_imag, s_imag = np.float32(0), np.float32(0), np.float32(0), np.float32(0)
        for t in range(p.size):
            real, imag = planes[0, t], planes[1, t]
            p_real += real * np.float32(p[t])
            p_imag += imag * np.float32(p[t])
            q_real += real * np.float32(q[t])
            q_imag += imag * np.float32(q[t])
            r_real += real * np.float32(r[t])
            r_imag += imag * np.float32(r[t])
            s_real += real * np.float32(s[t])
            s_imag += imag * np.float32(s[t])
        products[k, 0], products[k, 1] = p_real, p_imag
        products[k + 1, 0], products[k + 1, 1] = q_real, q_imag
        products[k + 2, 0], products[k + 2, 1] = r_real, r_imag
        products[k + 3, 0], products[k + 3, 1] = s_real, s_imag
        k += 4
    while k < end:
        capture = x[k]
        real_sum, imag_sum = np.float32(0), np.float32(0)
        for t in range(capture.size):
            real_sum += planes[0, t] * np.float32(capture[t])
            imag_sum += planes[1, t] * np.float32(capture[t])
        products[k, 0], products[k, 1] = real_sum, imag_sum
        k += 1


@part_in_any_order
def filtered_energy(capture: Array, spc: int) -> float:
    """Energy ``x^H F x`` of a capture, which is that of its correlation over ``spc (N + 1)``."""
    numbers = capture.size
    energy, sum_i, sum_q = np.float32(0), np.float32(0), np.float32(0)
    for t in range(numbers):
        energy += np.float32(capture[t]) * np.float32(capture[t])
    for t in range(0, numbers, 2):
        sum_i += np.float32(capture[t])
        sum_q += np.float32(capture[t + 1])
    for lag in range(1, spc):
        shift = 2 * lag
        product = np.float32(0)
        for t in range(numbers - shift):
            product += np.float32(capture[t]) * np.float32(capture[t + shift])
        for t in range(shift):
            product += np.float32(capture[numbers - shift + t]) * np.float32(capture[t])
        energy += np.float32(2 * (1 - lag / spc)) * product
    return energy - (sum_i * sum_i + sum_q * sum_q) / (numbers // (2 * spc) + 1)


@part_in_any_order
def add_weighted(x: Array, first: int, end: int, weights: Array, parts: Array) -> None:
    """Add captures times the real and times the imaginary parts of their weights to two sums; four at a time."""
    real, imag = parts[0], parts[1]
    k = first
    while k + 4 <= end:
        p, q, r, s = x[k], x[k + 1], x[k + 2], x[k + 3]
        p_real, q_real, r_real, s_real = weights[k, 0], weights[k + 1, 0], weights[k + 2, 0], weights[k + 3, 0]
        p_imag, q_imag, r_imag, s_imag = weights[k, 1], weights[k + 1, 1], weights[k + 2, 1], weights[k + 3, 1]
        for t in range(p.size):
            a, b, c, d = np.float32(p[t]), np.float32(q[t]), np.float32(r[t]), np.float32(s[t])
            real[t] += (p_real * a + q_real * b) + (r_real * c + s_real * d)
            imag[t] += (p_imag * a + q_imag * b) + (r_imag * c + s_imag * d)
        k += 4
    while k < end:
        capture, w_real, w_imag = x[k], weights[k, 0], weights[k, 1]
        for t in range(capture.size):
            real[t] += w_real * np.float32(capture[t])
            imag[t] += w_imag * np.float32(capture[t])
        k += 1


@part
def join(parts: Array, before: Array, out: Array) -> None:
    """Make one complex sum, flat I/Q, of the two of `add_weighted`, and add it to what was summed before."""
    for t in range(0, out.size, 2):
        out[t] = before[t] + (parts[0, t] - parts[1, t + 1])
        out[t + 1] = before[t + 1] + (parts[0, t + 1] + parts[1, t])


@part
def turn(x: Array, first: int, end: int, work: Work, weights: Array, products: Array) -> float:
    """Turn captures to the reference and add them; return the sum of the squared steps of their weights."""
    steps = 0.0
    for group in range(first, end, 4):
        last = min(group + 4, end)
        project(x, group, last, work.planes, products)
        for k in range(group, last):
            real, imag = products[k, 0], products[k, 1]
            size = np.sqrt(real * real + imag * imag)
            if size > 0:
                real, imag = real / size, -imag / size
            else:
                real, imag = np.float32(1), np.float32(0)
            steps += (real - weights[k, 0]) ** 2 + (imag - weights[k, 1]) ** 2
            weights[k, 0], weights[k, 1] = real, imag
        add_weighted(x, group, last, weights, work.parts)
    return steps


@part
def first_pass(x: Array, spc: int, begun: int, work: Work, weights: Array, products: Array) -> None:
    """Align captures to the sum of those before them, which is renewed whenever it has doubled."""
    work.parts[:] = 0
    first = 0
    if begun == 0:
        weights[0, 0] = 1
        add_weighted(x, 0, 1, weights, work.parts)
        first = 1
    while first < x.shape[0]:
        end = min(2 * first + begun, x.shape[0])
        join(work.parts, work.before, work.total)
        conjugate_planes(work.total, spc, work.planes)
        turn(x, first, end, work, weights, products)
        first = end
    join(work.parts, work.before, work.total)


@part
def next_pass(x: Array, spc: int, work: Work, weights: Array, products: Array) -> float:
    """Align each capture to the sum of all, and return the mean squared step of the weights."""
    conjugate_planes(work.total, spc, work.planes)
    work.parts[:] = 0
    steps = turn(x, 0, x.shape[0], work, weights, products)
    join(work.parts, work.before, work.total)
    return steps / x.shape[0]


@part
def align(x: Array, spc: int, begun: int, work: Work, weights: Array, products: Array) -> float:
    """Align captures (capture, number) with each other and with the ``begun`` captures in ``work.total``.

    Written: ``weights`` (capture, 2), real and imaginary part of the phasors that undo the phases; ``products``
    (capture, 2), inner products with the filtered sum of all. Returned: mean of ``x^H F x`` over some captures.
    """
    work.before[:] = work.total
    first_pass(x, spc, begun, work, weights, products)
    for _ in range(PASSES):
        if next_pass(x, spc, work, weights, products) < SETTLED:
            break
    energy, count, every = 0.0, 0, 1 + (x.shape[0] - 1) // ENERGIES
    for k in range(0, x.shape[0], every):
        energy += filtered_energy(x[k], spc)
        count += 1
    return energy / count


@part
def combine(x: Array, weights: Array, work: Work, out: Array) -> None:
    """Write the weighted sum of captures (capture, number) to ``out`` (number,)."""
    work.parts[:] = 0
    work.before[:] = 0
    add_weighted(x, 0, x.shape[0], weights, work.parts)
    join(work.parts, work.before, out)


@part
def project_all(x: Array, reference: Array, work: Work, products: Array) -> None:
    """Write the inner product of each capture with a reference (number,), unfiltered."""
    for t in range(0, reference.size, 2):
        work.planes[0, t], work.planes[0, t + 1] = reference[t], reference[t + 1]
        work.planes[1, t], work.planes[1, t + 1] = -reference[t + 1], reference[t]
    project(x, 0, x.shape[0], work.planes, products)


@jit
def align_int16(x: Array, spc: int, begun: int, work: Work, weights: Array, products: Array) -> float:
    """`align`, of int16."""
    return align(x, spc, begun, work, weights, products)


@jit
def align_float32(x: Array, spc: int, begun: int, work: Work, weights: Array, products: Array) -> float:
    """`align`, of float32."""
    return align(x, spc, begun, work, weights, products)


@jit
def combine_int16(x: Array, weights: Array, work: Work, out: Array) -> None:
    """`combine`, of int16."""
    combine(x, weights, work, out)


@jit
def combine_float32(x: Array, weights: Array, work: Work, out: Array) -> None:
    """`combine`, of float32."""
    combine(x, weights, work, out)


@jit
def project_int16(x: Array, reference: Array, work: Work, products: Array) -> None:
    """`project_all`, of int16."""
    project_all(x, reference, work, products)


@jit
def project_float32(x: Array, reference: Array, work: Work, products: Array) -> None:
    """`project_all`, of float32."""
    project_all(x, reference, work, products)
