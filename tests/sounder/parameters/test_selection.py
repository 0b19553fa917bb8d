"""Which paths count, of MPCs and of PDPs, and what is said about it."""

import numpy as np
import pytest
import xarray as xr

from sounder.options import Threshold
from sounder.parameters.position import position_parameters
from sounder.parameters.selection import select_mpcs, select_pdp

from .channels import table

MPCS = table(
    (100e-9, 0, 0, -100), (200e-9, 0, 0, -120), (300e-9, 0, 0, -131), snr=[40.0, 13.0, 20.0]
).assign_attrs(threshold="usc", samples=600 * 131068, independent_samples=6e4)  # fmt: skip


@pytest.mark.parametrize(
    ("threshold", "kept", "text"),
    [
        (None, 3, "MPCs extracted with 12 dB over noise"),
        ("15", 2, "15 dB over noise; of MPCs extracted with 12 dB over noise"),
        ("0,30", 2, "30 dB under the strongest; of MPCs extracted with 12 dB over noise"),
        ("0,inf,2e-7", 2, "delays up to 200 ns; of MPCs extracted with 12 dB over noise"),
        ("15,25,2.5e-7", 1, "15 dB over noise, 25 dB under the strongest, delays up to 250 ns; of MPCs extracted with"),
        ("99", 0, "99 dB over noise; of"),
        ("cfar", 2, "13.3 dB over noise; of MPCs extracted with 12 dB over noise"),
    ],
)
def test_mpcs_over_a_threshold(threshold, kept, text):
    selection = select_mpcs(MPCS, None if threshold is None else Threshold.of(threshold))
    assert selection.paths.sizes["mpc"] == kept
    assert selection.threshold.startswith(text)
    assert selection.definition.endswith("antennas: removed")


def profile(power, how, **attributes):
    delay = 1e-9 * np.arange(len(power))
    return xr.Dataset(
        {"pdp": ("delay", power)}, {"delay": delay}, {"omnidirectional": how, "pulse_energy": 1.0, **attributes}
    )


def test_noise_alone_has_no_parameters():
    rng = np.random.default_rng(1)
    noise = 10 * np.log10(rng.gamma(50, 1 / 50, 1000)) - 150  # of many beams
    selection = select_pdp(profile(noise, "sum"))
    assert selection.paths.sizes["mpc"] == 0
    result = position_parameters(selection, distance=30.0)
    assert float(result["mpcs"]) == 0
    assert np.isnan(float(result["rms_delay_spread"]))


def test_samples_of_a_pdp_over_the_noise():
    power = np.full(1000, -150.0)
    power[[100, 140]] = -100.0
    result = position_parameters(select_pdp(profile(power, "sum", pulse_energy=2.0)), distance=30.0)
    assert float(result["rms_delay_spread"]) == pytest.approx(20e-9, rel=1e-9)
    assert float(result["path_loss"]) == pytest.approx(100.0)  # two samples of half a path each
    # sqrt(2 N / P) of each power, 50 dB over the noise
    assert float(result["path_loss_std"]) == pytest.approx(10 / np.log(10) * np.sqrt(2 * 1e-5) / np.sqrt(2), rel=1e-3)
    assert np.isnan(float(result["azimuth_spread_arrival"]))
    assert "PDP: sum" in result.attrs["definition"]


def test_a_synthesis_has_no_noise():
    power = np.full(100, -np.inf)
    power[[10, 20]] = -100.0
    selection = select_pdp(profile(power, "synthesis"), Threshold(12.0, 30.0))
    assert selection.paths.sizes["mpc"] == 2
    assert (selection.noise, selection.antennas) == ("none in a synthesis", "removed (PDP: synthesis)")
