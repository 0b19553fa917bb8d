"""Transfer functions and impulse responses of other labs go the whole way to MPCs."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.constants import c

from erm.common.errors import DataError
from sounder.cir.impulse_response import calibrate, impulse_responses
from sounder.cir.responses import cut_density
from sounder.instrument.antenna_pattern import Pattern
from sounder.instrument.description import Sounder
from sounder.instrument.waveform import held_template
from sounder.options import Options
from sounder.processing.jobs import gather
from sounder.processing.position import FilterCache, process_recording
from sounder.recordings.pulses import cut_around_peak
from sounder.recordings.sweep import sweep_tables
from sounder.recordings.writer import write_recording

LAYOUT = Path(__file__).parents[4] / "examples" / "layouts" / "vna.toml"
AZIMUTH, ELEVATION = np.arange(60.0, 121.0, 10.0), np.array([-9.0, 0.0, 9.0])
TX, RX = np.array([0.0, 10.0, 2.0]), np.array([0.0, 0.0, 2.0])
PATHS = ((10.0 / c, 90.0, 0.0, -90.0), (61.3e-9, 73.0, 3.0, -104.0))
"""Delay, azimuth, elevation, gain."""
NOISE = -120.0
"""Of each frequency [dB]."""


def transfer_functions(frequency, sounder: Sounder, seed: int = 1):
    """S21 (azimuth, elevation, frequency) of the paths through the horn, with noise."""
    rng = np.random.default_rng(seed)
    antenna = sounder.rx_antenna
    pattern = Pattern.of(antenna)
    shape = (AZIMUTH.size, ELEVATION.size, frequency.size)
    total = 10 ** (NOISE / 20) * (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) / np.sqrt(2)
    for delay, azimuth, elevation, gain in PATHS:
        beams = antenna.gain + pattern.beam_gain(azimuth, elevation, AZIMUTH[:, None], ELEVATION[None])
        turns = np.exp(-2j * np.pi * frequency * delay)
        total += 10 ** ((gain + beams[..., None]) / 20) * turns
    return total


@pytest.fixture
def swept(tmp_path: Path, description):
    """Processes a sweep; returns the group of MPCs."""

    def process(frequency, response=1.0, layout: str | None = None):
        horn = {
            "pattern": "gaussian",
            "hpbw_azimuth": 10.0,
            "hpbw_elevation": 9.0,
            "sidelobe_floor": -30.0,
            "cut": None,
        }
        measured = transfer_functions(frequency, description(rx_antenna={"gain": 24.5, **horn})) * response
        with h5py.File(tmp_path / "vna.h5", "w") as file:
            content = {"S21": measured[None], "frequency": frequency, "azimuth": AZIMUTH, "elevation": ELEVATION}
            for name, data in {**content, "tx": TX, "rx": RX, "thru": response * np.ones(frequency.size)}.items():
                file[name] = data
        (tmp_path / "vna.toml").write_text(layout or LAYOUT.read_text(encoding="utf-8"), encoding="utf-8")
        jobs, failures = gather([tmp_path / "vna.h5"], layout=tmp_path / "vna.toml")
        assert failures == []
        groups, remarks = process_recording(jobs[0].recording, FilterCache().get(jobs[0])[0], Options())
        assert [remark.code for remark in remarks] == []
        return groups["/mpc"]

    return process


def assert_paths(mpc):
    """Both paths and no other, within four standard deviations, which are as small as the band allows."""
    assert mpc.sizes["mpc"] == len(PATHS)
    for name, true in zip(("delay", "azimuth", "elevation", "path_gain"), zip(*PATHS, strict=True), strict=True):
        off = (mpc[name].values - true) / mpc[f"{name}_std"].values
        assert np.abs(off).max() < 4, (name, mpc[name].values, true)
    assert mpc["delay_std"].values.max() < 0.02e-9


@pytest.mark.slow
@pytest.mark.parametrize("points", [501, 800])
def test_a_sweep_gives_the_paths(swept, points):
    mpc = swept(np.linspace(59e9, 61e9, points))
    assert_paths(mpc)
    assert mpc.attrs["period"] == pytest.approx((points - 1) / 2e9)


@pytest.mark.slow
def test_descending_frequencies_are_the_same_sweep(swept):
    ascending = swept(np.linspace(59e9, 61e9, 401))
    frequency = np.linspace(61e9, 59e9, 401)
    assert_paths(swept(frequency))
    assert ascending.attrs["period"] == pytest.approx(200e-9)


def test_a_thru_measurement_removes_the_cables(swept):
    frequency = np.linspace(59e9, 61e9, 401)
    ripple = (0.4 + 0.1 * np.cos(2 * np.pi * frequency * 1.5e-9)) * np.exp(-2j * np.pi * frequency * 7e-9)
    layout = LAYOUT.read_text(encoding="utf-8")
    uncommented = layout.replace("# [back", "[back").replace('# dataset = "thru"', 'dataset = "thru"')
    uncommented = uncommented.replace('# axes = ["frequency"]', 'axes = ["frequency"]').replace("# att", "att")
    assert_paths(swept(frequency, ripple, uncommented))


@pytest.mark.slow
def test_an_impulse_response_of_a_named_window_is_the_sweep_that_it_was_made_of(swept, tmp_path, description):
    frequency = np.linspace(59e9, 61e9, 401)
    expected = swept(frequency)
    horn = {"pattern": "gaussian", "hpbw_azimuth": 10.0, "hpbw_elevation": 9.0, "sidelobe_floor": -30.0, "cut": None}
    measured = transfer_functions(frequency, description(rx_antenna={"gain": 24.5, **horn}))
    cir = np.fft.ifft(np.fft.ifftshift(measured, axes=-1))
    with h5py.File(tmp_path / "cir.h5", "w") as file:
        for name, data in {"cir": cir, "azimuth": AZIMUTH, "elevation": ELEVATION, "tx": TX, "rx": RX}.items():
            file[name] = data
    layout = LAYOUT.read_text(encoding="utf-8").replace(
        'kind = "ctf"\ndataset = "S21"', 'kind = "cir"\ndataset = "cir"'
    )
    layout = layout.replace(
        'axes = ["position", "azimuth", "elevation", "frequency"]', 'axes = ["azimuth", "elevation", "delay"]'
    )
    start = layout.index("frequency = { dataset")
    layout = layout[:start] + 'sample_rate = 2.005e9\nwindow = "boxcar"\n' + layout[layout.index("\n", start) + 1 :]
    (tmp_path / "cir.toml").write_text(layout + "\n[sounder.carrier]\nfrequency = 60e9\n", encoding="utf-8")
    jobs, failures = gather([tmp_path / "cir.h5"], layout=tmp_path / "cir.toml")
    assert failures == []
    mpc = process_recording(jobs[0].recording, FilterCache().get(jobs[0])[0], Options())[0]["/mpc"]
    for name in ("delay", "azimuth", "elevation", "path_gain"):
        np.testing.assert_allclose(mpc[name], expected[name], atol=0.2 * expected[f"{name}_std"].values.max())


def test_responses_are_no_native_recording(tmp_path, opened, sounder):
    layout = """
[captures]
dataset = "cir"
kind = "cir"
window = "hann"
axes = ["azimuth", "elevation", "sample", "iq"]
[grid]
azimuth = [10, 100]
elevation = [0]
[positions]
tx = [0, 0, 28.4]
rx = [31, -46, 1.4]
"""
    (recording,), b2b = opened({"cir": np.ones((2, 1, 254, 2), np.int16)}, layout)
    assert abs(b2b.captures[0, 0]) == pytest.approx(1)
    with pytest.raises(DataError, match="captures are cir; a native recording holds IQ samples"):
        write_recording(recording, tmp_path / "native.h5", history="test")


def test_a_pulse_that_is_cut_around_its_peak_keeps_its_delay():
    pulse = np.zeros((2, 1022), np.complex64)
    pulse[:, [1020, 1021, 0, 1, 2, 3, 4]] = [1, 2, 4, 8, 4, 2, 1]
    cut = cut_around_peak(pulse, 300)
    assert cut.shape == (2, 300)
    assert cut[0, [298, 299, 0, 1, 2, 3, 4]].tolist() == [1, 2, 4, 8, 4, 2, 1]
    assert np.count_nonzero(cut) == 14


def test_frequencies_that_are_not_evenly_spaced_are_refused():
    frequency = np.linspace(1e9, 2e9, 101)
    frequency[50] += 2e5
    with pytest.raises(DataError, match=r"vna.h5: the frequencies of the sweep are not evenly spaced"):
        sweep_tables(frequency, Path("vna.h5"))


@pytest.mark.parametrize(
    ("replaced", "by", "complaint"),
    [
        ('frequency = { dataset = "frequency" }', "", 'kind "ctf" and the key frequency go together'),
        ('kind = "ctf"', 'kind = "iq"', 'kind "ctf" and the key frequency go together'),
        ('kind = "ctf"', 'kind = "ctf"\nwindow = "hann"', 'sample_rate and window are for kind "cir"'),
        ('kind = "ctf"', 'kind = "s21"', "captures.kind"),
    ],
)
def test_a_layout_that_contradicts_itself_is_refused(swept, replaced, by, complaint):
    with pytest.raises(DataError, match=complaint):
        swept(np.linspace(59e9, 61e9, 101), layout=LAYOUT.read_text(encoding="utf-8").replace(replaced, by, 1))


def test_correlated_captures_are_the_captures(tmp_path, opened, sounder):
    """Correlation with the template commutes with averaging, so both kinds give one CIR."""
    template = np.conj(np.fft.fft(held_template(sounder.sequence)))
    rng = np.random.default_rng(2)
    sent = np.fft.ifft(np.conj(template))
    iq = 0.1 * (rng.standard_normal((1, 4, 3, 2, 254)) + 1j * rng.standard_normal((1, 4, 3, 2, 254)))
    iq += np.roll(sent, 30)
    layout = """
[captures]
dataset = "KIND"
kind = "KIND"
axes = ["position", "azimuth", "elevation", "snapshot", "sample"]
[grid]
azimuth = [10, 100, 190, 280]
elevation = [-9, 0, 9]
[positions]
tx = [0, 0, 28.4]
rx = [31, -46, 1.4]
[back_to_back]
dataset = "KIND_b2b"
axes = ["sample"]
attenuation = 40.0
"""

    def correlated(x):
        return np.fft.ifft(np.fft.fft(x) * template).astype(np.complex64)

    content = {"iq": iq, "iq_b2b": sent, "cir": correlated(iq), "cir_b2b": correlated(sent)}
    # correlated with a sequence that begins 10 samples later, as the back-to-back, which is IQ, was not
    content |= {"later": np.roll(correlated(iq), 10, axis=-1) / iq.shape[-1], "later_b2b": sent}
    with h5py.File(tmp_path / "both.h5", "w") as file:
        for name, data in content.items():
            file[name] = data.astype(np.complex64)
    cirs = []
    later = layout.replace('kind = "KIND"', 'kind = "cir"').replace("[back_to_back]", '[back_to_back]\nkind = "iq"')
    later = later.replace("attenuation = 40.0", "attenuation = 40.0\nshift = 10").replace("KIND", "later")
    for text in (layout.replace("KIND", "iq"), later, layout.replace("KIND", "cir")):
        (recording,), b2b = opened(tmp_path / "both.h5", text)
        cirs.append(impulse_responses(recording, calibrate(b2b, recording))[0]["cir"].values)
    for other in cirs[1:]:
        np.testing.assert_allclose(other, cirs[0], atol=1e-4 * np.abs(cirs[0]).max())
    with pytest.raises(DataError, match="phase-aligned averaging needs IQ captures"):
        impulse_responses(recording, calibrate(b2b, recording), averaging="phase-aligned")


@pytest.mark.parametrize("kind", ["iq", "cir"])
def test_the_noise_of_a_cut_response_is_that_of_the_captures(opened, sounder, kind):
    """It has the spectrum of the template, held chips that are sampled, behind the same filter."""
    template = held_template(sounder.sequence)
    spectrum = np.fft.fft(template)
    through = np.exp(-((np.fft.fftfreq(254) / 0.65) ** 4))  # an instrument that passes less at the edge of the band
    sent = np.fft.ifft(spectrum * through)
    thru = sent if kind == "iq" else np.fft.ifft(spectrum * through * np.conj(spectrum)) / 254
    content = {"x": sent * np.ones((4, 3, 1)), "iq": sent, "y": np.zeros((4, 3, 180), complex), "thru": thru}
    grid = "[grid]\nazimuth = [10, 100, 190, 280]\nelevation = [-9, 0, 9]\n"
    places = "[positions]\ntx = [0, 0, 28.4]\nrx = [31, -46, 1.4]\n"
    waveform = "".join(f"{key} = {value!r}\n" for key, value in sounder.waveform.model_dump(mode="json").items())

    def filter_of(captures: str, thru: str):
        layout = f"[captures]\n{captures}\naxes = ['azimuth', 'elevation', 'sample']\n{grid}{places}[back_to_back]\n"
        layout += f"{thru}\naxes = ['sample']\nattenuation = 40.0\n[sounder.waveform]\n{waveform}"
        (recording,), b2b = opened({name: data.astype(np.complex64) for name, data in content.items()}, layout)
        return calibrate(b2b, recording)

    whole = filter_of("dataset = 'x'", "dataset = 'iq'")
    rate = sounder.waveform.sample_rate
    cut = filter_of(f"dataset = 'y'\nkind = 'cir'\nsample_rate = {rate}", f"dataset = 'thru'\nkind = '{kind}'")
    frequency = np.linspace(0.02, 0.4, 50)
    expected, found = (np.interp(frequency, np.arange(of.size) / of.size, of) for of in (whole.noise, cut.noise))
    np.testing.assert_allclose(found, expected, rtol=0.03)


def test_noise_behind_a_correlator_has_the_stated_density_where_it_was_cut():
    """The mean periodogram of white noise that was correlated and cut."""
    rng = np.random.default_rng(3)
    template = np.repeat(rng.choice([-1.0, 1.0], 60), 3) + 1j * rng.standard_normal(180)
    noise = (rng.standard_normal((4000, 180)) + 1j * rng.standard_normal((4000, 180))) / np.sqrt(2)
    cut = np.fft.ifft(np.fft.fft(noise) * np.conj(np.fft.fft(template)))[:, :50]
    found = np.mean(np.abs(np.fft.fft(cut)) ** 2, axis=0) / 50
    stated = cut_density(template, 50)
    np.testing.assert_allclose(found, stated, rtol=0.08)
