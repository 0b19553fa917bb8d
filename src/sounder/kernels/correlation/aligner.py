"""Alignment of captures that arrive in blocks: the phase of each against the sum of all so far."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from sounder.kernels.correlation import alignment
from sounder.kernels.correlation.captures import Captures, flat_captures

Complex = npt.NDArray[np.complex64]


class AlignedBlock(NamedTuple):
    """What is known of the captures of a block, with the filter ``F`` of `alignment`.

    Attributes
    ----------
    phasors : array complex64 (snapshot,)
        Factors of magnitude 1 that undo the phases.
    products : array complex64 (snapshot,)
        Inner products with the aligned sum ``s`` of the captures so far, with the block, ``s^H F x``.
    energy : float
        Mean energy of a capture, ``x^H F x``.
    reference_energy : float
        ``s^H F^2 s``: the variance of a product by white noise of variance 1 a sample.
    """

    phasors: Complex
    products: Complex
    energy: float
    reference_energy: float


class CaptureAligner:
    """Phases of captures of a held m-sequence, by maximum likelihood.

    With the correlation ``C``, captures ``x_k = exp(j phi_k) h + noise`` of one channel are the more likely the larger
    ``|sum_k exp(-j phi_k) C x_k|**2``. It grows when each capture is turned to the sum of all; that is repeated until
    the phases stand. The first reference is the first capture, and then the sum of those so far: two noisy captures
    have the whole gain of the sequence in common, so a peak need not be seen in either.

    Parameters
    ----------
    samples : int
        Samples of a capture.
    samples_per_chip : int

    References
    ----------
    N. Boumal, "Nonconvex phase synchronization", SIAM J. Optim. 26(4), 2016: the same iteration, its convergence.

    Examples
    --------
    >>> from sounder.instrument.waveform import m_sequence
    >>> sent = np.repeat(1 - 2 * m_sequence(7, (7, 1, 0)), 2)
    >>> captures = (sent * np.exp(1j * np.array([0.3, 1.3, 2.8]))[:, None]).astype(np.complex64)
    >>> aligner = CaptureAligner(254, samples_per_chip=2)
    >>> phasors = aligner.align(captures).phasors
    >>> np.angle(phasors / phasors[0]).round(2).tolist()  # undo the phases of the captures against the first
    [0.0, -1.0, -2.5]
    """

    def __init__(self, samples: int, samples_per_chip: int) -> None:
        self.count = 0
        self._samples, self._samples_per_chip = samples, samples_per_chip
        self._work = alignment.new_work(2 * samples)

    @property
    def total(self) -> Complex:
        """Sum of all captures so far, aligned (sample,)."""
        return self._work.total.view(np.complex64).copy()

    def align(self, iq: Captures) -> AlignedBlock:
        """Align captures, int16 (snapshot, sample, 2) or complex64 (snapshot, sample), and add them to the sum."""
        x = flat_captures(iq, self._samples)
        kernel = alignment.align_int16 if x.dtype == np.int16 else alignment.align_float32
        phasors, products = np.zeros((2, len(x), 2), np.float32)
        energy = kernel(x, self._samples_per_chip, self.count, self._work, phasors, products)
        self.count += len(x)
        reference = self._work.planes[0]
        return AlignedBlock(_complex(phasors), _complex(products), energy, float(reference @ reference))

    def combine(self, iq: Captures, weights: npt.NDArray[np.complexfloating]) -> Complex:
        """Weighted sum of captures (sample,)."""
        x = flat_captures(iq, self._samples)
        kernel = alignment.combine_int16 if x.dtype == np.int16 else alignment.combine_float32
        out = np.empty(2 * self._samples, np.float32)
        kernel(x, np.asarray(weights, np.complex64).view(np.float32).reshape(-1, 2), self._work, out)
        return out.view(np.complex64)

    def project(self, iq: Captures, reference: npt.NDArray[np.complexfloating]) -> Complex:
        """Inner product ``r^H x`` of each capture with a reference (sample,): complex64 (snapshot,)."""
        x = flat_captures(iq, self._samples)
        kernel = alignment.project_int16 if x.dtype == np.int16 else alignment.project_float32
        products = np.empty((len(x), 2), np.float32)
        kernel(x, np.asarray(reference, np.complex64).view(np.float32), self._work, products)
        return _complex(products)


def _complex(pairs: npt.NDArray[np.float32]) -> Complex:
    return pairs.view(np.complex64)[:, 0]
