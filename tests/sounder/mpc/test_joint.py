"""Paths whose pulses overlap: fitted together where the phase between them is the same in all directions."""

import numpy as np
import pytest

from sounder.instrument.antenna_pattern import Pattern
from sounder.mpc.extract import extract_mpcs

HORN = 24.5


def scan(bench, paths, noise, rng, *, shared):
    """CIRs with a phase between paths that is the same in all directions, or any in each."""
    horn, scanned = Pattern.of(bench.sounder.rx_antenna), bench.sounder.scan
    azimuth, elevation = np.array(scanned.azimuth)[:, None], np.array(scanned.elevation)
    shape = azimuth.size, elevation.size
    spectra, direction = 0, np.exp(2j * np.pi * rng.random(shape))
    for gain, delay, path_azimuth, path_elevation in paths:
        level = gain + horn.gain + horn.beam_gain(path_azimuth, path_elevation, azimuth, elevation)
        phase = direction * np.exp(2j * np.pi * rng.random()) if shared else np.exp(2j * np.pi * rng.random(shape))
        spectra = spectra + (10 ** (level / 20) * phase)[..., None] * np.exp(-2j * np.pi * bench.frequency * delay)
    cir = bench.cir(spectra) + bench.noise(rng, azimuth.size * elevation.size).reshape(*shape, -1) * 10 ** (noise / 20)
    return bench.dataset(cir.astype(np.complex64))


def draws(bench, late, fainter, count, *, shared, seed):
    """Errors (draw, path, delay or azimuth), the same over their standard deviations, and numbers of MPCs."""
    rng = np.random.default_rng(seed)
    errors, normalised, found = [], [], []
    for _ in range(count):
        azimuth, elevation, delay = rng.uniform(0, 360), rng.uniform(-9, 9), rng.uniform(30e-9, 800e-9)
        paths = [(-100.0, delay, azimuth, elevation), (-100.0 - fainter, delay + late, azimuth, elevation)]
        cir = scan(bench, paths, -100 + HORN - 30, rng, shared=shared)
        table = extract_mpcs(cir, bench.filter_, bench.sounder, threshold="usc")
        found.append(table.sizes["mpc"])
        if found[-1] < 2:
            continue
        both = table.isel(mpc=np.argsort(table["delay"].values[:2]))
        off = (both["azimuth"].values - azimuth + 180) % 360 - 180
        errors.append(np.stack([both["delay"].values - delay - [0, late], off], axis=-1))
        normalised.append(errors[-1] / np.stack([both["delay_std"].values, both["azimuth_std"].values], axis=-1))
    return np.array(errors), np.array(normalised), found


@pytest.mark.slow
def test_overlapping_paths_are_told_apart_with_honest_errors(bench):
    """A nanosecond apart in one beam, 0.6 chips, 30 and 24 dB over the noise, with one phase between them.

    Also where cancellation finds one path only. The delays' errors are stated as 0.051 ns (root mean square of 64 such
    pairs, whose RMSE is 0.050); three standard deviations of the RMSE of 32 delays more are 0.070. 32 normalised errors
    of mean square 1 exceed 2.1 once in 10^4 times.
    """
    errors, normalised, found = draws(bench, 1e-9, 6.0, 16, shared=True, seed=4)
    assert found == [2] * 16
    assert np.sqrt(np.mean(np.square(errors[..., 0]))) < 0.07e-9
    assert np.sqrt(np.mean(np.square(errors[..., 0] / normalised[..., 0]))) < 0.06e-9
    assert np.mean(np.square(normalised), axis=(0, 1)) == pytest.approx(1, abs=1.1)


@pytest.mark.slow
def test_paths_with_phases_of_their_own_stay_two(bench):
    """A chip apart, equal; no third path is made of what one phase between them does not explain."""
    errors, _, found = draws(bench, 1 / 600e6, 0.0, 16, shared=False, seed=5)
    assert np.mean(found) < 2.15
    assert np.sqrt(np.mean(np.square(errors[..., 0]))) < 0.05e-9
    assert np.sqrt(np.mean(np.square(errors[..., 1]))) < 0.4


@pytest.mark.slow
def test_a_path_below_the_fan_is_no_mpc_but_does_not_disturb_the_one_before_it(bench):
    """Half a resolution cell later, 8 degrees under the lowest beam of 9; taken for one, they are early by 0.05 ns."""
    rng = np.random.default_rng(6)
    for _ in range(3):
        azimuth, delay = rng.uniform(0, 360), rng.uniform(30e-9, 800e-9)
        paths = [(-100.0, delay, azimuth, -4.0), (-100.0, delay + 0.45e-9, azimuth, -17.0)]
        table = extract_mpcs(
            scan(bench, paths, -100 + HORN - 45, rng, shared=True), bench.filter_, bench.sounder, threshold="usc"
        )
        assert table.sizes["mpc"] == 1
        assert table["delay_std"].item() < 0.01e-9
        assert table["delay"].item() == pytest.approx(delay, abs=3.5 * table["delay_std"].item())
