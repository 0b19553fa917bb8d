"""Readable reference of the kernels in numpy, float64 and FFT. The tests compare every kernel with it."""

import numpy as np
import numpy.typing as npt

Complex = npt.NDArray[np.complex128]


def chip_template(chips: npt.ArrayLike, samples_per_chip: int) -> npt.NDArray[np.float64]:
    """Hold each chip for a number of samples; bit 0 is +1, bit 1 is -1."""
    return np.repeat(1.0 - 2.0 * np.asarray(chips, float), samples_per_chip)


def as_complex(iq: npt.NDArray[np.number]) -> Complex:
    """Read captures, integer (..., sample, 2) or complex (..., sample), as complex128."""
    if np.iscomplexobj(iq):
        return iq.astype(np.complex128)
    return iq[..., 0] + 1j * iq[..., 1].astype(float)


def correlate(iq: npt.NDArray[np.number], template: npt.ArrayLike) -> Complex:
    """Correlate captures with a periodic template: ``c[k] = sum_n x[n + k] conj(t[n])``, circular.

    A capture that is the template delayed by k samples peaks at k.
    """
    spectrum = np.fft.fft(as_complex(iq), axis=-1) * np.conj(np.fft.fft(np.asarray(template)))
    return np.fft.ifft(spectrum, axis=-1)


def average(iq: npt.NDArray[np.number], template: npt.ArrayLike) -> tuple[Complex, npt.NDArray[np.float64]]:
    """Average the correlation over snapshots (axis 0): coherent mean, and mean of the squared magnitude."""
    correlation = correlate(iq, template)
    return correlation.mean(0), (np.abs(correlation) ** 2).mean(0)


def align(iq: npt.NDArray[np.number], template: npt.ArrayLike, passes: int = 50) -> Complex:
    """Factors of magnitude 1 (snapshot,) that make ``|sum_k w_k c_k|**2`` of correlations ``c_k`` largest.

    Each capture is turned to the sum of those before it, and then, again and again, to the sum of all.
    """
    correlation = correlate(iq, template)
    weights = np.ones(len(correlation), complex)
    total = correlation[0].copy()
    for k in range(1, len(correlation)):
        weights[k] = np.exp(-1j * np.angle(np.vdot(total, correlation[k])))
        total += weights[k] * correlation[k]
    for _ in range(passes):
        weights = np.exp(-1j * np.angle(correlation @ np.conj(weights @ correlation)))
    return weights


def walsh_hadamard(z: Complex) -> Complex:
    """Transform over the rows (2**m, column), natural order: ``out[i] = sum_j (-1)^popcount(i & j) z[j]``."""
    rows, columns = z.shape
    half = 1
    while half < rows:
        pairs = z.reshape(rows // (2 * half), 2, half, columns)
        z = np.stack([pairs[:, 0] + pairs[:, 1], pairs[:, 0] - pairs[:, 1]], axis=1).reshape(rows, columns)
        half *= 2
    return z
