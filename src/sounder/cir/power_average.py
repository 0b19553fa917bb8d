"""Mean power over snapshots of the de-embedded responses."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from sounder.cir.deembedding import Deembedding
from sounder.cir.transforms import fast_length, fastest_transforms
from sounder.kernels.correlation import response_power
from sounder.kernels.correlation.captures import Captures, flat_captures

ROWS_BYTES = 2**19
"""Size of the rows that are transformed at a time. With their spectra they fit the second-level cache of a server, and
calls cost little: half as many rows take a tenth longer, twice as many no less."""

Complex = NDArray[np.complex128]


class PowerAverage:
    """Root of the mean power over snapshots, with the phase of the mean: for a channel that changes in between.

    The response of a snapshot ``x_k`` with the held template of spectrum ``T`` and the de-embedding filter ``G`` is
    ``h_k = IFFT(FFT(x_k) conj(T) G)``: two transforms, in single precision, are the bound of its cost. Nothing cheaper
    gives the power at every delay. It is the diagonal of ``A (sum_k x_k x_k^H) A^H`` for the circulant ``A``, but the
    sum of outer products costs N operations a sample, and the transforms some 5 log2(N) each.

    ``G`` has no DC; it is replaced for each snapshot as :meth:`~sounder.cir.deembedding.Deembedding.apply` does it.

    Parameters
    ----------
    template : array (sample,)
        Held sequence.
    deembedding : Deembedding
    """

    def __init__(self, template: NDArray[np.float64], deembedding: Deembedding) -> None:
        period = self.samples = template.size
        self._length = fast_length(period)
        kernel = np.fft.ifft(np.conj(np.fft.fft(template)) * deembedding.transfer)
        spectrum = np.fft.fft(kernel, self._length) / self._length
        self._spectrum = np.array([spectrum.real, spectrum.imag], np.float32)
        self._rows = max(ROWS_BYTES // (8 * self._length), 1)

    def __call__(self, blocks: Iterable[Captures]) -> Complex:
        """Average the captures of a direction: complex (sample,)."""
        count = 0
        squares, total = np.zeros(self.samples), np.zeros((2, self.samples))
        some_squares, some_total, planes = (
            np.empty(self.samples, np.float32),
            *np.empty((2, 2, self.samples), np.float32),
        )
        numbers = np.empty(self.samples, np.int32)
        rows = np.empty((self._rows, self._length), np.complex64)
        for captures in blocks:
            x = flat_captures(captures, self.samples)
            for first in range(0, len(x), self._rows):
                responses = self._responses(x, first, rows[: len(x) - first])
                response_power.add_responses(responses, planes, numbers, some_squares, some_total)
                squares += some_squares
                total += some_total
            count += len(x)
        phase: Complex = np.exp(1j * np.arctan2(total[1], total[0]))
        return np.sqrt(squares / count) * phase

    def _responses(self, x: Captures, first: int, rows: NDArray[np.complex64]) -> NDArray[np.float32]:
        """Responses of captures from one on, as many as ``rows``: (row, number), flat I/Q, not folded."""
        load = response_power.load_int16 if x.dtype == np.int16 else response_power.load_float32
        load(x, first, rows.view(np.float32))
        transforms = fastest_transforms()
        spectra = transforms.forward(rows)
        response_power.multiply(spectra.view(np.float32), self._spectrum)
        return transforms.backward(spectra).view(np.float32)
