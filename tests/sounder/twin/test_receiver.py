"""The twin's captures obey the physics they are named after."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from pydantic import ValidationError
from scipy.constants import k as boltzmann

from sounder import shipped
from sounder.instrument.description import load_sounder
from sounder.instrument.waveform import band_limited_template
from sounder.recordings import native
from sounder.recordings.writer import write_recording
from sounder.twin.faults import (
    AGC,
    CableDrift,
    Converter,
    DCOffset,
    DelayDrift,
    Faults,
    IQImbalance,
    PhaseNoise,
    SystemResponse,
    ThermalNoise,
)
from sounder.twin.receiver import back_to_back, record, transfer_functions

SOUNDER = load_sounder(shipped.calibration("sounder-132ghz.toml"))
FREQUENCY = np.fft.fftfreq(SOUNDER.waveform.samples, 1 / SOUNDER.waveform.sample_rate)
IN_BAND = (np.abs(FREQUENCY) < SOUNDER.bandwidth / 2) & (FREQUENCY != 0)
AHEAD = 7, 1  # index of azimuth 70 degree, elevation 0


def one_path(coefficient=1e-6, delay=300e-9, azimuth=70.0, elevation=0.0):
    columns = {"coefficient": coefficient, "delay": delay, "azimuth": azimuth, "elevation": elevation}
    return xr.Dataset({name: ("path", np.atleast_1d(value)) for name, value in columns.items()})


def position(paths, *, sounder=SOUNDER, faults=None, snapshots=1, seed=0, name="RX1", **options):
    places = {"tx_position": [0, 0, 28.4], "rx_position": [50, 0, 1.4]}
    return record(paths, sounder, name=name, snapshots=snapshots, faults=faults, seed=seed, **places, **options)


def volts(recording, direction=AHEAD):
    """Complex samples at the antenna's port [sqrt(mW)], averaged over snapshots."""
    iq = recording.captures(*direction).astype(float) @ [1, 1j]
    return iq.mean(axis=0) * recording.scale_factor / 10 ** (recording.agc_gain[direction] / 20)


def power(samples):
    return np.mean(np.abs(samples) ** 2)


def clean(level=-60.0, **present):
    """A faultless instrument whose converter is well used by a signal of the level [dBm]."""
    return Faults.absent(**{"converter": Converter(bits=16, full_scale=level + 10)} | present)


RECEIVED = 10 - 120 + 24.5 + 24.5  # dBm: transmit power, path gain of 1e-6, both antennas on boresight


def test_level_at_the_antenna_port_follows_the_link_budget():
    got = volts(position(one_path(), faults=clean(RECEIVED)))
    # a full-scale error of half a step of 2**-15 is under 1e-4 of the signal 10 dB below full scale
    assert 10 * np.log10(power(got)) == pytest.approx(RECEIVED, abs=0.001)


def test_division_by_the_back_to_back_gives_the_path_back():
    rng = np.random.default_rng(5)
    for _ in range(5):
        gain, delay = 1e-6 * np.exp(2j * np.pi * rng.random()), rng.uniform(50e-9, 1500e-9)
        system = SystemResponse(seed=int(rng.integers(1000)))
        b2b = back_to_back(SOUNDER, 60.0, snapshots=1, faults=clean(-50, system_response=system))
        y = np.fft.fft(volts(position(one_path(gain, delay), faults=clean(-61, system_response=system))))
        through = b2b.captures[0].astype(float) @ [1, 1j] * b2b.scale_factor
        channel = y / np.fft.fft(through) * 10 ** (-b2b.attenuation / 20) / 10 ** (SOUNDER.tx_antenna.gain / 20)
        expected = gain * 10 ** (24.5 / 20) * np.exp(-2j * np.pi * FREQUENCY * delay)
        # Rounding adds 2/12 LSB^2 a sample, 1022/6 a bin: 13 LSB deviation. A bin holds 0.3 * 32768 * sqrt(1022)
        # = 3e5 LSB on average, 30 dB less at the band's edge; the mean over the band is to hold 1e-3.
        ratio = channel[IN_BAND] / expected[IN_BAND]
        assert abs(ratio.mean() - 1) < 1e-3
        assert np.median(np.abs(ratio - 1)) < 1e-3


def test_attenuator_with_delay_is_in_the_captures():
    frequency = np.linspace(131e9, 133e9, 401)
    s21 = 1e-3 * np.exp(-2j * np.pi * frequency * 1.5e-9)
    faults = clean(-50)
    flat = back_to_back(SOUNDER, 60.0, snapshots=1, faults=faults)
    real = back_to_back(SOUNDER, (frequency, s21), snapshots=1, faults=faults)
    assert real.attenuation == pytest.approx(60.0, abs=1e-9)
    spectra = [np.fft.fft(b.captures[0].astype(float) @ [1, 1j])[IN_BAND] for b in (real, flat)]
    expected = np.exp(-2j * np.pi * (FREQUENCY[IN_BAND] + 132e9) * 1.5e-9)
    assert np.median(np.abs(spectra[0] / spectra[1] - expected)) < 1e-3


def test_twice_the_amplitude_is_6_02_db_more():
    faults = clean(RECEIVED + 6)
    one, two = (power(volts(position(one_path(a), faults=faults))) for a in (1e-6, 2e-6))
    assert 10 * np.log10(two / one) == pytest.approx(20 * np.log10(2), abs=1e-3)


def test_horn_attenuates_off_boresight_and_looks_where_the_path_comes_from():
    recording = position(one_path(azimuth=75.0), faults=clean(RECEIVED))
    powers = [[10 * np.log10(power(volts(recording, (a, e)))) for e in range(3)] for a in range(recording.azimuth.size)]
    assert powers[7][1] == pytest.approx(powers[8][1], abs=0.01)  # 70 and 80 degree, 5 off each
    assert powers[7][1] == pytest.approx(RECEIVED - 3.01, abs=0.05)  # half of the 10 degree beamwidth
    assert np.argmax(np.max(powers, axis=1)) in (7, 8)


def test_delay_beyond_the_period_wraps():
    period = SOUNDER.waveform.period
    near = transfer_functions(one_path(delay=100e-9), SOUNDER, np.array([70.0]), np.array([0.0]))
    far = transfer_functions(one_path(delay=100e-9 + period), SOUNDER, np.array([70.0]), np.array([0.0]))
    assert np.allclose(near, far, rtol=1e-9)


def test_no_paths_are_noise_of_power_ktbf():
    faults = Faults.absent(thermal_noise=ThermalNoise(noise_figure=7.0), agc=AGC())
    samples = position(one_path().isel(path=slice(0)), faults=faults, snapshots=64)
    iq = samples.captures(3, 2).astype(float) * samples.scale_factor / 10 ** (samples.agc_gain[3, 2] / 20)
    expected = 1e3 * boltzmann * 290 * 1.2e9 * 10**0.7
    # the mean of n independent |z|^2 has the relative deviation 1/sqrt(n): 5 of them
    n = iq.shape[0] * iq.shape[1]
    assert power(iq @ [1, 1j]) / expected == pytest.approx(1, abs=5 / np.sqrt(n))


def test_agc_recorded_is_agc_applied_and_moves_in_steps():
    with_agc = clean(-42, agc=AGC(step=2.0))
    paths = one_path(azimuth=70.0)
    fixed = position(paths, faults=clean(-42))
    recording = position(paths, faults=with_agc)
    gain = recording.agc_gain
    assert np.all(gain % 2 == 0)
    assert gain.min() >= 0
    assert gain.max() > gain[AHEAD]
    ratio = recording.captures(*AHEAD).astype(float).std() / fixed.captures(*AHEAD).astype(float).std()
    assert 20 * np.log10(ratio) == pytest.approx(gain[AHEAD], abs=0.01)
    # power lands between headroom and headroom + one step under full scale
    level = 10 * np.log10(power(recording.captures(*AHEAD).astype(float) @ [1, 1j]) / 2**30)
    assert -14.01 <= level <= -11.99


@pytest.mark.parametrize("clipped", [0, 10, 500, 1022])
def test_clipping_holds_the_ends_of_int16(clipped):
    inside = np.sort(np.abs(band_limited_template(SOUNDER.waveform).real))
    bounds = np.concatenate([[0.5 * inside[0]], (inside[1:] + inside[:-1]) / 2, [2 * inside[-1]]])
    level = 20 * np.log10(bounds[inside.size - clipped]) + RECEIVED
    faults = clean(converter=Converter(bits=16, full_scale=level))
    iq = position(one_path(delay=0.0), faults=faults).captures(*AHEAD)[0, :, 0]
    # a sample within half an LSB of full scale rounds to it, be it over or under
    near = np.sum(np.abs(inside / bounds[inside.size - clipped] - 1) < 2**-15)
    assert np.sum(np.isin(iq, [-(2**15), 2**15 - 1])) == pytest.approx(clipped, abs=int(near))


def test_quantisation_uses_the_bits_it_has():
    iq = position(one_path(), faults=clean(RECEIVED, converter=Converter(bits=6, full_scale=RECEIVED + 8)))
    codes = np.unique(iq.captures(*AHEAD))
    assert np.all(codes[codes < 2**15 - 1] % 2**10 == 0)


def test_dc_offset_is_the_mean():
    faults = clean(converter=Converter(bits=16), dc_offset=DCOffset(i=0.01, q=-0.02))
    empty = one_path().isel(path=slice(0))
    mean = position(empty, faults=faults).captures(*AHEAD).mean(axis=(0, 1))
    assert mean == pytest.approx([0.01 * 2**15, -0.02 * 2**15], abs=0.5)


def test_iq_imbalance_makes_an_image_of_the_stated_level():
    rng = np.random.default_rng(1)
    x = rng.standard_normal(100000) + 1j * rng.standard_normal(100000)
    y = IQImbalance(gain=0.5, phase=3.0).apply(x)
    g, phi = 10 ** (0.5 / 20), np.radians(3)
    assert np.allclose(y.real, x.real)
    assert np.allclose(y.imag, g * (x.imag * np.cos(phi) - x.real * np.sin(phi)))
    # E[y x] over E|x|^2 is beta, E[y conj x] is alpha, for circular x
    image = abs(np.mean(y * x)) / abs(np.mean(y * np.conj(x)))
    expected = abs((1 - g * np.exp(1j * phi)) / (1 + g * np.exp(-1j * phi)))
    assert image == pytest.approx(expected, abs=5 / np.sqrt(x.size))


def test_wiener_phase_spreads_with_the_square_root_of_time():
    rng = np.random.default_rng(2)
    noise = PhaseNoise(linewidth=1e3, interval=1e-5)
    ends = np.array([noise.phase(rng, 4, 256, 1.2e9)[:, -1] for _ in range(2000)])
    for snapshot in range(4):
        elapsed = snapshot * 1e-5 + 255 / 1.2e9
        # relative deviation of a variance from n draws is sqrt(2/n) = 3.2 %: 5 of them
        assert ends[:, snapshot].var() == pytest.approx(2 * np.pi * 1e3 * elapsed, rel=5 * np.sqrt(2 / 2000))


def test_drifts_start_where_they_should_and_stay_in_bounds():
    azimuth = np.arange(0.0, 360, 10)
    factor = CableDrift(phase=20, amplitude=0.3).factor(np.random.default_rng(3), azimuth)
    assert np.abs(20 * np.log10(np.abs(factor))).max() <= 0.3 + 1e-12
    assert 19 < np.degrees(np.abs(np.angle(factor))).max() <= 20
    delays = np.array([DelayDrift(step=1e-12).delay(np.random.default_rng(s), 101) for s in range(2000)])
    assert np.all(delays[:, 0] == 0)
    assert delays[:, -1].std() == pytest.approx(10e-12, rel=5 / np.sqrt(2 * 2000))


def test_delay_drifts_step_by_step_in_the_order_of_the_scan():
    everywhere = SOUNDER.rx_antenna.model_copy(update={"pattern": "flat"})
    deaf_to_direction = SOUNDER.model_copy(update={"rx_antenna": everywhere})
    spectra = []
    for faults in (clean(RECEIVED, delay_drift=DelayDrift(step=0.1e-9)), clean(RECEIVED)):
        recording = position(one_path(), sounder=deaf_to_direction, faults=faults)
        samples = [volts(recording, (a, e)) for e in range(3) for a in range(36)]  # azimuth turns first
        spectra.append(np.fft.fft(samples))
    middle = np.flatnonzero(IN_BAND & (np.abs(FREQUENCY) < 300e6))
    middle = middle[np.argsort(FREQUENCY[middle])]
    phase = np.unwrap(np.angle(spectra[0] / spectra[1])[:, middle])
    delay = np.polyfit(FREQUENCY[middle], phase.T, 1)[0] / (-2 * np.pi)
    assert delay[0] == pytest.approx(0, abs=1e-12)
    # the deviation of n normal steps is known to 1/sqrt(2 n): 5 of them; any other order skips and so adds up steps
    assert np.diff(delay).std() == pytest.approx(0.1e-9, rel=5 / np.sqrt(2 * 107))


@pytest.mark.slow
def test_system_response_is_the_same_in_both_recordings_and_has_the_stated_ripple():
    spread = [
        (20 * np.log10(np.abs(SystemResponse(slope=0, ripple=0.6, seed=s).response(FREQUENCY)))).std()
        for s in range(200)
    ]
    # sampled over a finite band, so each instrument differs; the ensemble's mean square is the ripple's
    assert np.sqrt(np.mean(np.square(spread))) == pytest.approx(0.6, rel=0.2)


def test_same_seed_same_bytes_and_any_slice_is_part_of_the_whole():
    first, again = (position(one_path(), seed=4, snapshots=4) for _ in range(2))
    assert np.array_equal(again.captures(20, 0), first.captures(20, 0))
    assert np.array_equal(again.captures(*AHEAD, slice(1, 3)), first.captures(*AHEAD)[1:3])
    assert not np.array_equal(first.captures(*AHEAD), first.captures(8, 1))
    for other in (position(one_path(), seed=5, snapshots=4), position(one_path(), seed=4, snapshots=4, name="RX2")):
        assert not np.array_equal(other.captures(*AHEAD), first.captures(*AHEAD))


def test_noise_differs_in_every_direction():
    quiet = position(one_path().isel(path=slice(0)))
    noise = [quiet.captures(a, e).tobytes() for a in range(36) for e in range(3)]
    assert len(set(noise)) == len(noise)


def test_each_fault_changes_the_captures_by_itself():
    reference = position(one_path(azimuth=73.0), faults=clean(RECEIVED + 10), snapshots=2).captures(*AHEAD)
    for name, field in Faults.model_fields.items():
        if name == "converter":
            continue
        faults = clean(RECEIVED + 10, **{name: field.default})
        assert not np.array_equal(
            position(one_path(azimuth=73.0), faults=faults, snapshots=2).captures(*AHEAD), reference
        ), name


def test_switches_read_as_toml_writes_them():
    faults = Faults.model_validate({"agc": False, "phase_noise": True, "dc_offset": {"i": 0.1}})
    assert faults.agc is None
    assert faults.phase_noise == PhaseNoise()
    assert faults.dc_offset == DCOffset(i=0.1)
    assert faults.thermal_noise == ThermalNoise()
    with pytest.raises(ValidationError, match="extra"):
        Faults.model_validate({"phase_nois": False})


def test_native_file_holds_what_the_twin_made(tmp_path):
    time = 1.7e9 + np.arange(108.0).reshape(3, 36).T
    recording = replace(position(one_path(), snapshots=2, los=1), time=time)
    target = tmp_path / "RX1.h5"
    write_recording(recording, target, history="test")
    (read,) = native.recordings(target)
    assert np.array_equal(read.captures(5, 2), recording.captures(5, 2))
    assert np.array_equal(read.agc_gain, recording.agc_gain)
    assert read.los == 1
    assert read.sounder == recording.sounder
    assert np.array_equal(read.time, time)
