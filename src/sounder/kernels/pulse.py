"""A pulse of known shape in a row of samples: fit its amplitude and delay, add and take it away.

The pulse is tabulated ``over`` times a sample, from ``-reach`` to ``reach`` samples, and linear between; delays are
circular.
"""

import numpy as np
import numpy.typing as npt

from sounder.kernels.compile import part

Row = npt.NDArray[np.complex64]
Table = npt.NDArray[np.complex128]

FIT_REACH = 3
"""Samples to each side that a fit uses: the main lobe, where neighbours disturb least."""


@part
def pulse_at(table: Table, over: int, offset: float) -> complex:
    """Value of the pulse ``offset`` samples after its peak; zero beyond the table."""
    place = offset * over + (table.size - 1) / 2
    left = int(np.floor(place))
    if left < 0 or left >= table.size - 1:
        return 0j
    part_ = place - left
    return table[left] * (1 - part_) + table[left + 1] * part_


@part
def amplitude_at(row: Row, table: Table, over: int, delay: float) -> complex:
    """Least-squares amplitude of a pulse at ``delay`` [sample]."""
    centre = round(delay)
    size = row.size
    inner = 0j
    energy = 0.0
    for k in range(centre - FIT_REACH, centre + FIT_REACH + 1):
        p = pulse_at(table, over, k - delay)
        inner += row[k % size] * np.conj(p)
        energy += p.real**2 + p.imag**2
    return inner / energy


@part
def fit_delay(row: Row, table: Table, over: int, start: float) -> float:
    """Delay [sample] at which the fitted amplitude is largest, within one sample of ``start``.

    Parabolas through three points of the fitted power, over shrinking steps: the power is smooth and has one maximum
    over the main lobe.
    """
    delay = start
    for step in (0.5, 0.25, 0.1, 0.03, 0.01):
        before = abs(amplitude_at(row, table, over, delay - step)) ** 2
        here = abs(amplitude_at(row, table, over, delay)) ** 2
        after = abs(amplitude_at(row, table, over, delay + step)) ** 2
        curvature = before - 2 * here + after
        if curvature < 0:
            delay += step * min(max(0.5 * (before - after) / curvature, -1.0), 1.0)
        elif before > after:
            delay -= step
        else:
            delay += step
    return min(max(delay, start - 1), start + 1)


@part
def add_pulse(row: Row, table: Table, over: int, delay: float, amplitude: complex) -> None:
    """Add a pulse in place."""
    reach = (table.size - 1) // (2 * over)
    centre = round(delay)
    size = row.size
    for k in range(centre - reach, centre + reach + 1):
        row[k % size] += amplitude * pulse_at(table, over, k - delay)
