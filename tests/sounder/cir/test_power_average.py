"""Mean power of responses: that of numpy in double precision, whichever library transforms."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.fft

from sounder.cir import transforms
from sounder.cir.power_average import PowerAverage
from sounder.cir.transforms import fast_length, fastest_transforms

pytestmark = pytest.mark.slow


def deembedding_of(rng, samples):
    """Any smooth transfer without DC."""
    frequency = np.fft.fftfreq(samples)
    transfer = np.exp(-((frequency / 0.2) ** 2) + 3j * np.sin(7 * frequency)) * rng.uniform(1, 2)
    transfer[0] = 0
    return SimpleNamespace(transfer=transfer)


def mean_power(captures, template, transfer):
    """Readable: each response less its median, squares averaged, and the mean response for the phase."""
    spectrum = np.conj(np.fft.fft(template)) * transfer
    responses = np.fft.ifft(np.fft.fft(captures) * spectrum)
    responses -= (np.median(responses.real, axis=1) + 1j * np.median(responses.imag, axis=1))[:, None]
    return np.mean(np.abs(responses) ** 2, axis=0), responses.mean(axis=0)


@pytest.mark.parametrize("kind", ["int16", "complex64"])
@pytest.mark.parametrize("samples", [1022, 390])  # folded, and transformed as it is
def test_power_is_that_of_double_precision(samples, kind):
    rng = np.random.default_rng(samples)
    template = rng.choice([-1.0, 1.0], samples)
    captures = np.rint(rng.normal(0, 3000, (75, samples, 2)) + 500 * np.roll(template, 9)[:, None])
    numbers = captures @ [1, 1j]
    deembedding = deembedding_of(rng, samples)
    given = captures.astype(np.int16) if kind == "int16" else numbers.astype(np.complex64)
    got = PowerAverage(template, deembedding)([given[:40], given[40:]])
    power, mean = mean_power(numbers, template, deembedding.transfer)
    # transforms in single precision; the peak of 500 and 75 snapshots stand 1e4 and 1e2 over the noise of the mean
    np.testing.assert_allclose(np.abs(got) ** 2, power, rtol=2e-5)
    strong = np.abs(mean) > 0.3 * np.abs(mean).max()
    np.testing.assert_allclose(np.angle(got[strong] * np.conj(mean[strong])), 0, atol=1e-3)


def test_lengths_are_of_small_factors():
    for order in range(7, 16):
        for spc in range(1, 5):
            period = spc * (2**order - 1)
            length = fast_length(period)
            assert length == period or length >= 2 * period
            assert length == 1 or max(f for f in range(2, 14) if length % f == 0) <= 13


@pytest.mark.parametrize("installed", [[], ["mkl_fft"], ["pyfftw"], ["mkl_fft", "pyfftw"]])
def test_the_fastest_installed_library_transforms(monkeypatch, installed):
    """MKL before FFTW before scipy; stand-ins with the documented arguments of theirs."""
    used = []

    def stand_in(name, transform):
        def transformed(rows, axis=-1, norm=None, **options):
            used.append(name)
            assert set(options) <= {"planner_effort", "overwrite_x"}
            return transform(rows, axis=axis, norm=norm)

        return transformed

    both = {which: getattr(scipy.fft, which) for which in ("fft", "ifft")}
    for name in ("mkl_fft", "pyfftw", "pyfftw.interfaces"):
        monkeypatch.setitem(sys.modules, name, None)
    if "mkl_fft" in installed:
        made = {which: stand_in("mkl_fft", transform) for which, transform in both.items()}
        monkeypatch.setitem(sys.modules, "mkl_fft", SimpleNamespace(**made))
    if "pyfftw" in installed:
        made = {which: stand_in("pyfftw", transform) for which, transform in both.items()}
        interfaces = SimpleNamespace(cache=SimpleNamespace(enable=lambda: None), scipy_fft=SimpleNamespace(**made))
        monkeypatch.setitem(sys.modules, "pyfftw", SimpleNamespace(interfaces=interfaces))
        monkeypatch.setitem(sys.modules, "pyfftw.interfaces", interfaces)
        monkeypatch.setitem(sys.modules, "pyfftw.interfaces.scipy_fft", interfaces.scipy_fft)
    rows = np.random.default_rng(1).normal(size=(3, 64)).astype(np.complex64)
    found = transforms.fastest_transforms.__wrapped__()
    back = found.backward(found.forward(rows.copy())) / 64
    np.testing.assert_allclose(back, rows, atol=1e-6)
    assert used == 2 * installed[:1]


def test_transforms_are_not_scaled():
    row = np.zeros((1, 8), np.complex64)
    row[0, 1] = 1
    found = fastest_transforms()
    np.testing.assert_allclose(found.backward(found.forward(row.copy())), 8 * row, atol=1e-6)
