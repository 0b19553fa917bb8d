"""Phases of captures by maximum likelihood: what the kernels find against the readable version."""

import numpy as np
import pytest

from sounder.kernels.correlation import reference
from sounder.kernels.correlation.aligner import CaptureAligner

pytestmark = pytest.mark.slow


def captures_of(rng, template, phases, noise, kind):
    """Two paths in white noise of a standard deviation, in LSB, with an offset of the receiver."""
    channel = 800 * np.roll(template, 20) + 300j * np.roll(template, 75)
    spread = noise / np.sqrt(2)
    white = rng.normal(0, spread, (len(phases), template.size, 2)) @ [1, 1j]
    captures = np.exp(1j * phases)[:, None] * channel + white + (90 - 50j)
    if kind == "complex64":
        return captures.astype(np.complex64)
    return np.rint(np.stack([captures.real, captures.imag], -1)).astype(np.int16)


@pytest.mark.parametrize("kind", ["int16", "complex64"])
@pytest.mark.parametrize(("order", "spc"), [(7, 1), (7, 2), (9, 2), (8, 3), (7, 4)])
def test_phases_are_those_of_the_inner_products_of_correlations(m_sequence, order, spc, kind):
    rng = np.random.default_rng(order)
    template = reference.chip_template(m_sequence(order), spc)
    captures = captures_of(rng, template, 2 * np.pi * rng.random(23), 100.0, kind)
    aligner = CaptureAligner(template.size, spc)
    block = aligner.align(captures)
    expected = reference.align(captures, template)
    # both start from the first capture, but its last turn, by its own noise, is common to all
    turned = block.phasors * np.conj(block.phasors[0] / expected[0])
    # the SNR is 18 dB and the captures gain 21 dB and more: what the last passes still turn is 1e-5 and less
    np.testing.assert_allclose(turned, expected, atol=1e-4)

    correlations = reference.correlate(captures, template)
    filtered = spc * (1 << order)
    total = block.phasors @ correlations
    np.testing.assert_allclose(aligner.total, block.phasors @ reference.as_complex(captures), rtol=1e-5, atol=1.0)
    # products are with the sum before the last turn, of 1e-5
    np.testing.assert_allclose(block.products, correlations @ np.conj(total) / filtered, rtol=1e-4)
    energies = np.sum(np.abs(correlations) ** 2, axis=1) / filtered
    # sixteen captures stand for all; they differ by the noise of 2 / sqrt(127 * SNR) each at most
    assert block.energy == pytest.approx(energies.mean(), rel=0.02)
    spectrum = np.abs(np.fft.fft(template)) ** 2 / filtered
    norm = np.sum(np.abs(spectrum * np.fft.fft(aligner.total)) ** 2) / template.size
    assert block.reference_energy == pytest.approx(norm, rel=1e-4)


def test_weighted_sums_and_inner_products_are_those_of_numpy(m_sequence):
    rng = np.random.default_rng(2)
    template = reference.chip_template(m_sequence(7), 2)
    captures = captures_of(rng, template, np.zeros(11), 500.0, "int16")
    weights = rng.normal(size=(11, 2)) @ [1, 1j]
    probe = rng.normal(size=(254, 2)) @ [1, 1j]
    aligner, signal = CaptureAligner(254, 2), reference.as_complex(captures)
    np.testing.assert_allclose(aligner.combine(captures, weights), weights @ signal, rtol=1e-4, atol=0.1)
    np.testing.assert_allclose(aligner.project(captures, probe), signal @ np.conj(probe), rtol=1e-4, atol=1.0)


def test_blocks_are_aligned_to_what_came_before(m_sequence):
    """One phase for all blocks: the sum of 40 captures in four blocks is 40 captures tall."""
    rng = np.random.default_rng(3)
    template = reference.chip_template(m_sequence(9), 2)
    captures = captures_of(rng, template, 2 * np.pi * rng.random(40), 800.0, "int16")
    aligner = CaptureAligner(1022, 2)
    for first in range(0, 40, 10):
        aligner.align(captures[first : first + 10])
    peak = np.abs(reference.correlate(aligner.total, template)[20])
    clean = np.abs(reference.correlate(800 * np.roll(template, 20) + 300j * np.roll(template, 75), template)[20])
    # 0 dB a capture: the phase is known to 1/sqrt(2 * 1022) = 0.02 rad, and the noise of the mean is 1/sqrt(40 * 1022)
    assert peak / 40 / clean == pytest.approx(1, abs=0.02)
