"""Lobes of spectra whose spreads are known in closed form."""

import numpy as np
import pytest

from sounder.parameters.lobes import mean_lobe_spreads

AZIMUTH, ELEVATION = np.arange(0.0, 360.0, 10.0), np.array([-10.0, 0.0, 10.0])


def spectrum(strong: dict[tuple[int, int], float]) -> np.ndarray:
    pas = np.full((36, 3), -np.inf)
    for beam, power in strong.items():
        pas[beam] = power
    return pas


def spread(*degrees: float) -> float:
    """Circular standard deviation of equal powers, TR 38.901 (A-1)."""
    return float(np.degrees(np.sqrt(-2 * np.log(abs(np.exp(1j * np.radians(degrees)).mean())))))


@pytest.mark.parametrize("turned", [0, 1, 17, 35])
@pytest.mark.parametrize("gain", [0.0, -95.5])
def test_the_mean_is_over_lobes_wherever_the_circle_begins(turned, gain):
    """One lobe of two azimuths, across 0 / 360 in one case, one of two elevations; beams 10.1 dB lower are in none."""
    beams = {(0, 1): -3.0, (1, 1): -3.0, (2, 1): -10.1, (18, 0): 0.0, (18, 1): 0.0, (18, 2): -10.1, (25, 2): -20.0}
    pas = spectrum(
        {((azimuth + turned) % 36, elevation): power + gain for (azimuth, elevation), power in beams.items()}
    )
    expected = spread(0, 10) / 2, spread(0, 10) / 2
    assert mean_lobe_spreads(AZIMUTH, ELEVATION, pas) == pytest.approx(expected, abs=1e-9)


def test_ends_of_a_sector_are_no_neighbours():
    ends = spectrum({(0, 1): 0.0, (34, 1): 0.0})[:35]
    assert mean_lobe_spreads(AZIMUTH[:35], ELEVATION, ends) == pytest.approx((0, 0), abs=1e-9)
    across_east = (AZIMUTH[:35] - 170) % 360
    assert mean_lobe_spreads(across_east, ELEVATION, ends) == pytest.approx((0, 0), abs=1e-9)
    assert mean_lobe_spreads(AZIMUTH, ELEVATION, spectrum({(0, 1): 0.0, (35, 1): 0.0}))[0] == pytest.approx(
        spread(0, 10)
    )


def test_what_was_not_scanned_is_not_known():
    assert np.isnan(mean_lobe_spreads(AZIMUTH, ELEVATION, spectrum({}))).all()
    assert np.isnan(mean_lobe_spreads(AZIMUTH, ELEVATION, np.full((36, 3), np.nan))).all()
    azimuth, elevation = mean_lobe_spreads(AZIMUTH, np.zeros(1), spectrum({(4, 1): 0.0})[:, 1:2])
    assert azimuth == pytest.approx(0, abs=1e-9)
    assert np.isnan(elevation)
