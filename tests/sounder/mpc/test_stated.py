"""What is stated about calibration, survey and antennas enters the standard deviations of MPCs."""

import numpy as np
import pytest
import xarray as xr

from erm.common.constants import c
from sounder import calibrate, extract_mpcs, impulse_responses, load_sounder, shipped
from sounder.instrument.stated import Connection, Survey
from sounder.mpc.stated import stated_variance
from sounder.mpc.table import LARGEST_STD
from sounder.twin.receiver import back_to_back, record

DESCRIBED = load_sounder(shipped.calibration("sounder-132ghz.toml"))


def test_without_statements_nothing_is_added() -> None:
    assert not stated_variance(DESCRIBED, np.array([1e-7, 2e-7])).any()


def test_variances_are_those_of_random_surveys() -> None:
    """Move both ends of random links by the stated errors; the path between them changes by the stated deviations."""
    rng = np.random.default_rng(5)
    s = 0.02
    described = DESCRIBED.model_copy(update={"survey": Survey(position_std=s)})
    rx, tx = np.zeros(3), np.array([60.0, 0.0, 0.0])
    moved = (tx + s * rng.normal(size=(20000, 3))) - (rx + s * rng.normal(size=(20000, 3)))
    length = np.linalg.norm(moved, axis=1)
    delay_std, azimuth_std, elevation_std, _ = np.sqrt(stated_variance(described, np.array([60.0 / c]))[0])
    # 20000 draws give a standard deviation to 0.5 %; five times that
    assert delay_std == pytest.approx(np.std(length / c), rel=0.025)
    assert azimuth_std == pytest.approx(np.std(np.degrees(np.arctan2(moved[:, 1], moved[:, 0]))), rel=0.025)
    assert elevation_std == pytest.approx(np.std(np.degrees(np.arcsin(moved[:, 2] / length))), rel=0.025)


@pytest.mark.slow
def test_an_mpc_holds_what_is_stated() -> None:
    path = {"coefficient": 1e-5, "delay": 200e-9, "azimuth": 13.0, "elevation": 2.0}
    paths = xr.Dataset({key: ("path", [value]) for key, value in path.items()})
    scan = DESCRIBED.scan.model_copy(update={"azimuth": (0.0, 10.0, 20.0, 30.0)})
    stated = DESCRIBED.model_copy(
        update={
            "scan": scan,
            "survey": Survey(position_std=0.05, heading_std=0.4, tilt_std=0.3),
            "back_to_back": Connection(attenuation_std=0.5, delay_std=20e-12),
            "rx_antenna": DESCRIBED.rx_antenna.model_copy(update={"gain_std": 0.7}),
        }
    )
    plain = DESCRIBED.model_copy(update={"scan": scan})
    recording = record(paths, plain, name="A", tx_position=(60, 0, 2), rx_position=(0, 0, 2), snapshots=2)
    filter_ = calibrate(back_to_back(plain, 60.0), recording)
    cir, _ = impulse_responses(recording, filter_, threads=1)
    without, with_ = (extract_mpcs(cir, filter_, sounder) for sounder in (plain, stated))
    expected = np.sqrt(stated_variance(stated, with_["delay"].values))
    for i, name in enumerate(("delay", "azimuth", "elevation", "path_gain")):
        assert np.array_equal(with_[name], without[name])
        combined = np.minimum(np.hypot(without[f"{name}_std"], expected[:, i]), LARGEST_STD[i])
        assert with_[f"{name}_std"].values == pytest.approx(combined.values, rel=1e-9)
    assert expected[0, 3] == pytest.approx(np.hypot(0.5, 0.7))


@pytest.mark.slow
def test_errors_of_the_pattern_are_those_of_random_horns(bench_maker, description) -> None:
    """Measure a strong path with 60 horns that differ from the described one as it states."""
    rng = np.random.default_rng(9)
    width, gain_error, width_error = 10.0, 0.02, 0.03
    antenna = {"pattern": "gaussian", "cut": None, "hpbw_azimuth": width, "hpbw_elevation": width}
    scan = {"azimuth": (0.0, 10.0, 20.0, 30.0), "elevation": (-10.0, 0.0, 10.0)}
    stated = antenna | {"gain_error": gain_error, "beamwidth_error": width_error}
    bench = bench_maker(description(rx_antenna=stated, scan=scan))
    found = []
    for _ in range(60):
        factor = 1 + width_error * rng.normal()
        wide = {"hpbw_azimuth": width * factor, "hpbw_elevation": width * factor}
        horn = bench_maker(description(rx_antenna=antenna | wide, scan=scan))
        cir = horn.scan([(-100.0, 200e-9, 13.0, 2.0)], noise=-180.0, same_phase=True)
        cir["cir"].values *= 1 + gain_error * rng.normal(size=(4, 3, 1))
        found.append(extract_mpcs(cir, bench.filter_, bench.sounder).isel(mpc=0))
    for name in ("azimuth", "elevation", "path_gain"):
        measured = np.std([float(one[name]) for one in found])
        stated_std = np.mean([float(one[f"{name}_std"]) for one in found])
        assert stated_std == pytest.approx(measured, rel=0.3), name  # 60 draws give 9 %; three times that
