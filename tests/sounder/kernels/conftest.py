"""Sequences and paths that the kernel tests share."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest

from sounder.cir.matched_filter import OVERSAMPLING
from sounder.instrument.antenna_pattern import Pattern
from sounder.kernels.correlation import avx512_instructions
from sounder.kernels.extraction.records import ARRIVAL, ARTEFACT, DEPARTURE
from sounder.kernels.extraction.scan_view import AntennaView, ScanView, beam_table, cut_table, link_table
from sounder.mpc.beams import ONE_BEAM

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


@pytest.fixture(params=["portable", pytest.param("registers", marks=pytest.mark.slow)])
def path(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Either way to compute; correlators made in the test take it."""
    if request.param == "registers":
        take_registers(monkeypatch)
    else:
        monkeypatch.setenv("SOUNDER_PORTABLE_KERNELS", "1")
    return request.param


@pytest.fixture
def registers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Correlators made in the test take the path for AVX-512."""
    take_registers(monkeypatch)


def take_registers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Take the path for AVX-512, where there is none with its one instruction of its own written as sums of products.

    LLVM makes several narrower registers of each wide one. Machine code of that is kept as any other; nothing but these
    tests asks for it on a machine without AVX-512.
    """
    monkeypatch.delenv("SOUNDER_PORTABLE_KERNELS", raising=False)
    if not avx512_instructions.available():
        monkeypatch.setattr(avx512_instructions, "_pair_sums", pair_sums)
        monkeypatch.setattr(avx512_instructions, "available", lambda: True)


def pair_sums(b, x, y):
    """What `llvm.x86.avx512.pmaddw.d.512` computes."""
    wide = avx512_instructions.ir.VectorType(avx512_instructions.I32, 2 * avx512_instructions.LANES)
    products = b.mul(b.sext(x, wide), b.sext(y, wide))
    even, odd = (
        avx512_instructions.shuffle(b, products, products, range(first, 2 * avx512_instructions.LANES, 2))
        for first in (0, 1)
    )
    return b.add(even, odd)


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
        arrival = AntennaView(
            end=ARRIVAL,
            stride=1,
            beams=beam_table(directions),
            azimuth_cut=cut_table(pattern.azimuth_cut),
            elevation_cut=cut_table(pattern.elevation_cut),
            floor=pattern.floor * np.log(10) / 20,
            azimuths=azimuths,
            elevations=elevations,
            full_circle=circle,
            azimuth_reach=10.0,
            lowest=-27.0,
            highest=27.0,
            beamwidth=9.0,
            azimuth_resolution=5.0,
            elevation_resolution=9.0,
        )
        return ScanView(
            links=link_table(noise, np.where(np.isfinite(noise), noise * 10**1.2, np.inf)),
            arrival=arrival,
            departure=ONE_BEAM.view(end=DEPARTURE, stride=len(directions)),
            pulse=Hann.table(),
            matched=Hann.table(3),
            artefacts=np.empty(0, ARTEFACT),
            oversampling=OVERSAMPLING,
            amplitude_variance=1 / np.sum(Hann.at(np.arange(-3, 4)) ** 2),
            margin_above=2.0,
            margin_below=4.0,
            delay_resolution=1.1,
            remainder=0.1,
            sidelobe_remainder=2.0,
            sidelobe_level=10**-1.5,
        )

    return make
