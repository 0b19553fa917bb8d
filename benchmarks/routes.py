"""The competitors: other ways from captures (snapshot, sample, 2) of a direction to mean correlation and mean power.

Those that are not what a user would write at first are at their best: single precision, blocks that stay in the
cache, conversion and squaring compiled and fused, padding where that is faster, the coherent mean transformed once.
"""

from collections.abc import Callable
from functools import partial

import numpy as np
import numpy.typing as npt
import scipy.fft
from harness import Captures
from numba import njit

Averages = tuple[npt.NDArray[np.complex128], npt.NDArray[np.float64]]
Route = Callable[[Captures], Averages]
Template = npt.NDArray[np.float64]

BLOCK_BYTES = 1 << 19


def scipy_loop(iq: Captures, template: Template) -> Averages:
    """`scipy.signal.correlate` in a loop over captures."""
    from scipy.signal import correlate

    mean, power = np.zeros(template.size, complex), np.zeros(template.size)
    for capture in iq[..., 0] + 1j * iq[..., 1]:
        twice = np.concatenate([capture, capture[:-1]])
        c = correlate(twice, template, mode="valid", method="fft")
        mean += c
        power += np.abs(c) ** 2
    return mean / len(iq), power / len(iq)


def numpy_batch(iq: Captures, template: Template) -> Averages:
    """All captures of a direction at once, as one would write it."""
    x = iq[..., 0] + 1j * iq[..., 1]
    c = np.fft.ifft(np.fft.fft(x, axis=1) * np.conj(np.fft.fft(template)), axis=1)
    return c.mean(0), (np.abs(c) ** 2).mean(0)


@njit(nogil=True, fastmath=True)
def _load(x: Captures, first: int, block: npt.NDArray[np.float32], total: npt.NDArray[np.int32]) -> None:
    for i in range(block.shape[0]):
        for t in range(x.shape[1]):
            block[i, t] = x[first + i, t]
            total[t] = np.int32(total[t] + np.int32(x[first + i, t]))


@njit(nogil=True, fastmath=True)
def _add_power(c: npt.NDArray[np.complex64], period: int, power: npt.NDArray[np.float32]) -> None:
    fold = c.shape[1] - period
    for i in range(c.shape[0]):
        if fold == 0:
            for k in range(period):
                power[k] += c[i, k].real * c[i, k].real + c[i, k].imag * c[i, k].imag
        else:
            for k in range(period):
                y = c[i, k] + c[i, fold + k]
                power[k] += y.real * y.real + y.imag * y.imag


class Blocks:
    """An FFT library in blocks of captures."""

    def __init__(self, template: Template, length: int, forward: Callable, inverse: Callable) -> None:
        self.template, self.forward, self.inverse = template, forward, inverse
        self.rows = max(1, BLOCK_BYTES // (8 * length))
        self.block = np.zeros((self.rows, length), np.complex64)
        self.spectrum = np.conj(np.fft.fft(template, length)).astype(np.complex64)

    def __call__(self, iq: Captures) -> Averages:
        x = iq.reshape(len(iq), -1)
        period = self.template.size
        total, power = np.zeros(2 * period, np.int32), np.zeros(period, np.float32)
        for first in range(0, len(x), self.rows):
            block = self.block[: min(self.rows, len(x) - first)]
            _load(x, first, block.view(np.float32), total)
            spectra = self.forward(block)
            spectra *= self.spectrum
            _add_power(self.inverse(spectra), period, power)
        mean = (total / len(x)).view(complex)
        c = np.fft.ifft(np.fft.fft(mean) * np.conj(np.fft.fft(self.template)))
        return c, power.astype(float) / len(x)


def scipy_blocks(template: Template, length: int) -> Blocks:
    return Blocks(template, length, scipy.fft.fft, partial(scipy.fft.ifft, overwrite_x=True))


def mkl_blocks(template: Template, length: int) -> Blocks:
    import mkl_fft

    route = Blocks(template, length, partial(mkl_fft.fft, axis=1), partial(mkl_fft.ifft, axis=1))
    out = np.empty_like(route.block)
    route.forward = lambda block: mkl_fft.fft(block, axis=1, out=out[: len(block)])
    # Not in place: mkl_fft 2 is wrong there for single long rows.
    back = np.empty_like(route.block)
    route.inverse = lambda spectra: mkl_fft.ifft(spectra, axis=1, out=back[: len(spectra)])
    return route


class FftwBlocks(Blocks):
    """FFTW, planned by measuring."""

    def __init__(self, template: Template, length: int) -> None:
        import pyfftw

        self.plans: dict[int, tuple[Callable, Callable]] = {}
        super().__init__(template, length, self._forward, self._inverse)
        self.spectra = pyfftw.empty_aligned(self.block.shape, np.complex64)
        self.result = pyfftw.empty_aligned(self.block.shape, np.complex64)
        self.block = pyfftw.zeros_aligned(self.block.shape, np.complex64)

    def _planned(self, rows: int) -> tuple[Callable, Callable]:
        import pyfftw

        if rows not in self.plans:
            kept = self.block[:rows].copy()  # planning writes to it
            planned = partial(pyfftw.FFTW, axes=(1,), flags=("FFTW_MEASURE",), threads=1)
            spectra, result = self.spectra[:rows], self.result[:rows]
            self.plans[rows] = (
                planned(self.block[:rows], spectra, direction="FFTW_FORWARD"),
                planned(spectra, result, direction="FFTW_BACKWARD", normalise_idft=True),
            )
            self.block[:rows] = kept
        return self.plans[rows]

    def _forward(self, block: npt.NDArray[np.complex64]) -> npt.NDArray[np.complex64]:
        return self._planned(len(block))[0]()

    def _inverse(self, spectra: npt.NDArray[np.complex64]) -> npt.NDArray[np.complex64]:
        return self._planned(len(spectra))[1]()


def fft_routes(template: Template) -> dict[str, Blocks]:
    """Make every FFT route whose library is installed: at the period's own length, and padded and folded."""
    padded = 1 << (2 * template.size - 1).bit_length()
    made: dict[str, Blocks] = {}
    for name, make in (("scipy.fft", scipy_blocks), ("MKL", mkl_blocks), ("FFTW", FftwBlocks)):
        for length in (template.size, padded):
            try:
                made[f"{name} {length} in blocks"] = make(template, length)
            except ImportError:
                print(f"{name}: not installed, left out (pip install --group bench)")
                break
    return made


def check(name: str, got: Averages, expected: Averages, of_peak: float) -> None:
    """Stop when a route does not compute the same."""
    for one, other in zip(got, expected, strict=True):
        error = np.abs(one - other).max() / np.abs(other).max()
        if not error <= of_peak:
            raise SystemExit(f"{name}: off by {error:.1e} of the peak, expected {of_peak:.0e} at most")
