"""The PDP synthesised from MPCs is what isotropic antennas would have received."""

import numpy as np
import pytest
import xarray as xr

from sounder.cir.power_spectrum import daps
from sounder.mpc.omnidirectional_pdp import synthesize_pdp, with_synthesis

from .extraction import mpcs


def decibel(power):
    return 10 * np.log10(power)


def test_the_synthesis_of_a_path_is_its_pulse(bench):
    rate, size = bench.filter_.sample_rate, bench.filter_.weight.size
    power = synthesize_pdp(np.array([100 / rate]), np.array([-90.0]), bench.filter_)
    np.testing.assert_allclose(power, 1e-9 * np.abs(np.roll(bench.filter_.pulse, 100)) ** 2, rtol=1e-9, atol=1e-21)
    # the pulse is band-limited, so that its energy does not depend on where the samples lie (Parseval)
    between = synthesize_pdp(np.array([(100.37 + size) / rate]), np.array([-90.0]), bench.filter_)
    assert between.sum() == pytest.approx(power.sum(), rel=1e-9)
    assert between.argmax() == 100  # modulo the period


def test_powers_are_added(bench):
    delay, gain = np.array([50e-9, 50e-9, 300e-9]), np.array([-100.0, -100.0, -110.0])
    both = synthesize_pdp(delay, gain, bench.filter_)
    each = sum(synthesize_pdp(delay[i : i + 1], gain[i : i + 1], bench.filter_) for i in range(3))
    np.testing.assert_allclose(both, each, rtol=1e-12)


def test_a_path_above_the_scan_has_its_gain_in_the_synthesis_alone(bench):
    """The scan ends at 9 degree; a beam of 10 degree loses 12 (5 / 10)^2 = 3 dB toward 14 degree."""
    paths = [(-100.0, 200e-9, 40.0, 14.0), (-105.0, 400e-9, 200.0, 0.0)]
    beams = daps(bench.scan(paths, noise=-150.0), bench.sounder)
    made = with_synthesis(beams, mpcs(bench, paths, noise=-150.0), bench.filter_)
    at = [round(when * bench.filter_.sample_rate) for when in (200e-9, 400e-9)]
    assert made["pdp"].values[at] == pytest.approx([-100.0, -105.0], abs=0.5)
    assert float(beams["pdp"][at[0]]) < -102.5
    assert made.attrs["omnidirectional"] == "synthesis"
    assert made["pdp"].attrs["long_name"].endswith("synthesis from MPCs, antennas removed")
    assert beams["pdp"].attrs["long_name"].endswith("sum of the beams over their overlap")


def test_without_mpcs_there_is_no_power(bench):
    nothing = xr.Dataset({name: ("mpc", np.empty(0)) for name in ("delay", "path_gain")})
    made = with_synthesis(daps(bench.scan([], noise=-150.0), bench.sounder), nothing, bench.filter_)
    assert np.isneginf(made["pdp"]).all()
