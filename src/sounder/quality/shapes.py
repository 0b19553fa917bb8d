"""What explains the response of a beam: the shape that others see, at their delay or later."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sounder.quality.clock import ALIKE, LEAST_GAIN
from sounder.quality.delays import SIGMAS, UNRESOLVED, Delays

Complex = NDArray[np.complexfloating]
Integers = NDArray[np.int64]

ABOUT = 4
"""Samples to either side of a peak over which shapes are compared: a pulse, and what moves its peak. Chosen."""


@dataclass(frozen=True)
class Shapes:
    """Responses of beams, to be compared about the delays of paths.

    Attributes
    ----------
    responses : array complex (beam, sample)
    noise : array (beam,)
        Noise power of a sample.
    """

    responses: Complex
    noise: NDArray[np.floating]

    def explains(self, delays: Delays, others: NDArray[np.bool_], row: int, shift: int) -> bool:
        """Whether the beam of a delay sees the path as other beams do, but for its gain and a shift.

        The others have in common ``r``, the first principal component of their responses about the peak. What is left
        of the response ``h`` of the beam,

            ``min_a sum |h(t + s) - a r(t)|^2 / sum |h(t + s)|^2``,

        is noise if it is shifted by ``s``. Another path that moves its peak by as much leaves more: a path 14 dB below
        moves it by `UNRESOLVED`, and leaves the square of that.

        Parameters
        ----------
        delays : Delays
        others : array (delay,)
            The delays with which it is compared.
        row : int
            Number of the delay.
        shift : int
            Delay of the beam against the others [sample].
        """
        about = delays.sample[row] + np.arange(-ABOUT, ABOUT + 1)
        size, beam = self.responses.shape[1], delays.beam[row]
        seen = self.responses[delays.beam[others]][:, about % size]
        common = np.linalg.svd(seen / np.linalg.norm(seen, axis=1, keepdims=True), full_matrices=False)[2][0]
        own = self.responses[beam, (about + shift) % size]
        energy = np.sum(np.abs(own) ** 2)
        left = energy - np.abs(np.vdot(common, own)) ** 2
        noise = self.noise[beam] * (about.size + SIGMAS * np.sqrt(about.size))
        return bool(left < UNRESOLVED**2 * energy + noise)

    def explain_loss(self, delays: Delays, later: NDArray[np.bool_], shift: int) -> bool:
        """Whether beams after a loss of samples hold what those before it see, later by its shift.

        A loss shifts all of them, but where it began is not known to a direction: those explained without the shift
        stand against as many, and `LEAST_GAIN` must remain.

        Parameters
        ----------
        delays : Delays
        later : array (delay,)
            The delays in beams after the loss.
        shift : int
            Their delay against those before it [sample].
        """
        shifted = unshifted = 0
        for path in np.unique(delays.path[later]):
            rows = delays.path == path
            before = rows & ~later
            if not before.any():
                continue
            before &= np.abs(delays.delay - np.median(delays.delay[before])) < ALIKE
            for row in np.flatnonzero(rows & later) if before.sum() > 1 else ():
                shifted += self.explains(delays, before, int(row), shift)
                unshifted += self.explains(delays, before, int(row), 0)
        return shifted > LEAST_GAIN + unshifted
