"""Sequences and paths that the kernel tests share."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest

from sounder.cir.matched_filter import OVERSAMPLING
from sounder.instrument.antenna_pattern import Pattern
from sounder.kernels.correlation import avx512_instructions
from sounder.kernels.extraction.records import ARTEFACT
from sounder.kernels.extraction.scan_view import ScanView, beam_table, cut_table

# s[n + order] is the sum (mod 2) of s[n + tap]: one primitive polynomial an order.
TAPS = {
    7: (0, 1),
    8: (0, 2, 3, 4),
    9: (0, 4),
    10: (0, 3),
    11: (0, 2),
    12: (0, 1, 4, 6),
    13: (0, 1, 3, 4),
    14: (0, 1, 3, 5),
    15: (0, 1),
}

Chips = npt.NDArray[np.int8]


def make_sequence(order: int, taps: tuple[int, ...] | None = None) -> Chips:
    chips = [0] * (order - 1) + [1]
    for n in range((1 << order) - 1 - order):
        chips.append(sum(chips[n + tap] for tap in taps or TAPS[order]) % 2)
    return np.array(chips, np.int8)


@pytest.fixture(scope="session")
def m_sequence() -> Callable[..., Chips]:
    """Maker of m-sequences: order, and taps where the usual ones will not do."""
    return make_sequence


@pytest.fixture(params=["vector", "portable"])
def path(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Either way to compute; correlators made in the test take it."""
    monkeypatch.setenv("SOUNDER_PORTABLE_KERNELS", "1" if request.param == "portable" else "0")
    if request.param == "vector" and not avx512_instructions.available():
        pytest.skip("the processor has no AVX-512")
    return request.param


class Hann:
    """A pulse of known form: a Hann-windowed band of 0.9 of the sample rate, which is three sinc pulses."""

    reach = 20
    """Samples to each side that are tabulated."""

    @staticmethod
    def at(t: npt.ArrayLike) -> npt.NDArray[np.float64]:
        x = 0.9 * np.asarray(t)
        return np.sinc(x) + 0.5 * (np.sinc(x - 1) + np.sinc(x + 1))

    @classmethod
    def table(cls, reach: int = reach) -> npt.NDArray[np.complex128]:
        return cls.at(np.arange(-(reach + 1) * OVERSAMPLING, (reach + 1) * OVERSAMPLING + 1) / OVERSAMPLING).astype(
            complex
        )

    @classmethod
    def row(cls, delay: float, size: int) -> npt.NDArray[np.float64]:
        """The pulse on a circle of samples, as far as it is tabulated."""
        late = (np.arange(size) - delay + size / 2) % size - size / 2
        return np.where(np.abs(np.round(late)) <= cls.reach, cls.at(late), 0)


@pytest.fixture(scope="session")
def hann() -> type[Hann]:
    return Hann


@pytest.fixture(scope="session")
def make_view() -> Callable[..., ScanView]:
    """Maker of views that see `Hann` pulses by least squares over the main lobe, best in white noise."""

    def make(
        pattern: Pattern, directions: npt.ArrayLike, noise: npt.ArrayLike, azimuths: int, elevations: int, circle: bool
    ) -> ScanView:
        directions = np.asarray(directions, float)
        noise = np.broadcast_to(noise, len(directions))
        return ScanView(
            beams=beam_table(noise, np.where(np.isfinite(noise), noise * 10**1.2, np.inf), directions),
            azimuth_cut=cut_table(pattern.azimuth_cut),
            elevation_cut=cut_table(pattern.elevation_cut),
            pulse=Hann.table(),
            matched=Hann.table(3),
            artefacts=np.empty(0, ARTEFACT),
            oversampling=OVERSAMPLING,
            azimuths=azimuths,
            elevations=elevations,
            full_circle=circle,
            azimuth_reach=10.0,
            lowest=-27.0,
            highest=27.0,
            beamwidth=9.0,
            floor=pattern.floor * np.log(10) / 20,
            amplitude_variance=1 / np.sum(Hann.at(np.arange(-3, 4)) ** 2),
            margin_above=2.0,
            margin_below=4.0,
            delay_resolution=1.1,
            azimuth_resolution=5.0,
            elevation_resolution=9.0,
            remainder=0.1,
            sidelobe_remainder=2.0,
            sidelobe_level=10**-1.5,
        )

    return make
