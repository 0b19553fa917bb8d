"""Waveforms that are no m-sequence: codes as published, and channels that come back through them."""

from pathlib import Path

import numpy as np
import pytest

from erm.common.errors import DataError
from sounder.cir.deembedding import make_deembedding
from sounder.cir.responses import correlator_of
from sounder.instrument.acquisition import acquire
from sounder.instrument.codes import gold, gps_ca, zadoff_chu
from sounder.instrument.description import Sounder, load_sounder
from sounder.instrument.periodic import Periodic
from sounder.recordings.recording import BackToBack

CAPTURE = Path(__file__).parents[4] / "shared/data/instrument/gps/GSoC_CTTC_capture_2012_07_26_4Msps_4ms.dat"
WAVEFORMS = [
    {"kind": "gps_ca", "prn": 3, "chip_rate": 1.023e6, "sample_rate": 4e6},  # 3.91 samples a chip
    {"kind": "gold", "order": 7, "polynomial": [7, 3, 0], "second_polynomial": [7, 3, 2, 1, 0], "shift": 5,
     "sample_rate": 1e9, "samples": 128},  # padded to 2^n
    {"kind": "zadoff_chu", "length": 139, "root": 25, "sample_rate": 1e9},
    {"kind": "zadoff_chu", "length": 139, "root": 25, "sample_rate": 1e9, "samples": 128},  # cut
    {"kind": "chirp", "samples": 500, "bandwidth": 4e8, "sample_rate": 1e9},
    {"kind": "multitone", "samples": 256, "tones": 200, "sample_rate": 1e9},
]  # fmt: skip


def sending(keys: dict, description) -> Sounder:
    tables = description(tx_antenna={"gain": 0.0, "pattern": "flat"}).model_dump()
    return Sounder.from_tables({**tables, "waveform": keys, "processing": {}}, "test")


def autocorrelation(code: np.ndarray) -> np.ndarray:
    return np.fft.ifft(np.abs(np.fft.fft(code)) ** 2)


@pytest.mark.parametrize(("prn", "octal"), [(1, "1440"), (2, "1620"), (3, "1710"), (7, "1131"), (24, "1706")])
def test_the_first_chips_of_satellites_are_those_that_gps_publishes(prn, octal):
    bits = "".join(str(int(chip.real < 0)) for chip in gps_ca(prn)[:10])
    assert int(bits, 2) == int(octal, 8)


def test_codes_have_the_correlations_that_they_were_made_for():
    # a preferred pair of odd order n: the three values -1 and -1 +- 2^((n+1)/2)
    pair = [gold(7, (7, 3, 0), (7, 3, 2, 1, 0), shift) for shift in (5, 9)]
    crossed = np.fft.ifft(np.fft.fft(pair[0]) * np.conj(np.fft.fft(pair[1]))).real.round()
    assert set(crossed) <= {-1.0, 15.0, -17.0}
    assert np.allclose(autocorrelation(zadoff_chu(139, 25))[1:], 0, atol=1e-9)
    assert np.allclose(np.abs(zadoff_chu(64, 3)), 1)


@pytest.mark.parametrize("keys", WAVEFORMS)
def test_a_channel_comes_back_through_any_waveform_and_instrument(keys, description):
    sounder = sending(keys, description)
    waveform = sounder.waveform
    rng = np.random.default_rng(5)
    instrument = np.fft.fft(np.exp(-np.arange(waveform.samples) / 1.5) * rng.uniform(0.5, 1, waveform.samples))
    sent = np.fft.fft(waveform.sampled) * instrument
    delays, gains = np.array([20, 41]), np.array([1.0, 0.4j])
    channel = np.zeros(waveform.samples, complex)
    channel[delays] = gains
    correlator = correlator_of("iq", sounder)
    thru, received = np.fft.ifft(sent), np.fft.ifft(sent * np.fft.fft(channel))
    b2b = BackToBack(Path("b2b"), sounder, thru[None].astype(np.complex64), 1.0, 0.0, None, True)
    filter_ = make_deembedding(b2b, correlator.correlate_mean(thru), sounder, 1.0)
    cir = filter_.apply(correlator.correlate_mean(received))
    wanted = np.fft.ifft(np.fft.fft(channel) * np.fft.fft(filter_.pulse))
    # the filter is linear and knows the instrument; the line at the carrier alone is not measured, and its constant
    # is chosen by a median that both paths move
    assert np.abs((cir - cir.mean()) - (wanted - wanted.mean())).max() < 0.02
    assert abs(filter_.pulse[0]) == pytest.approx(1.0)


def test_a_template_is_read_from_beside_the_description_and_nowhere_else(tmp_path, description):
    rng = np.random.default_rng(2)
    template = rng.normal(size=(64, 2)).round(3)
    rows = "\n".join(f"{i},{q}" for i, q in template)
    (tmp_path / "template.csv").write_text(f"I,Q\n{rows}\n")
    text = """
name = "own"
carrier.frequency = 28e9
tx_antenna = { gain = 0.0, pattern = "flat" }
rx_antenna = { gain = 0.0, pattern = "flat" }
scan = { azimuth = [0], elevation = [0] }
waveform = { file = "template.csv", sample_rate = 1e9 }
"""
    (tmp_path / "own.toml").write_text(text)
    sounder = load_sounder(tmp_path / "own.toml")
    assert np.allclose(sounder.waveform.sampled, template @ [1, 1j])
    again = type(sounder).model_validate_json(sounder.model_dump_json())  # as products store it
    assert again == sounder
    (tmp_path / "own.toml").write_text(text.replace("template.csv", "/etc/passwd"))
    with pytest.raises(DataError, match="is not in the folder of this file"):
        load_sounder(tmp_path / "own.toml")


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ({"kind": "gps_ca"}, "kind is gps_ca, which needs prn"),
        ({"kind": "gps_ca", "prn": 33, "sample_rate": 1.023e6}, "waveform.prn is 33"),
        ({"kind": "gps_ca", "prn": 1, "chip_rate": 1.3e6}, "1023 chips take 786.923 samples"),
        ({"kind": "multitone", "samples": 64, "tones": 70}, "70 tones do not fit into 64 lines"),
        ({"kind": "noise"}, "waveform.kind is 'noise'"),
    ],
)
def test_a_waveform_that_cannot_be_is_one_line(keys, expected, description):
    with pytest.raises(DataError) as error:
        sending({"sample_rate": 1e6, **keys}, description)
    assert expected in str(error.value)


def test_noise_holds_no_code():
    codes = {f"{prn}": gps_ca(prn) for prn in (1, 2)}
    rng = np.random.default_rng(4)
    assert acquire(rng.normal(size=2046) + 1j * rng.normal(size=2046), codes, 1.023e6, max_offset=2e3) == []


@pytest.mark.slow
@pytest.mark.skipif(not CAPTURE.is_file(), reason="the capture is beside the clone only")
def test_a_capture_of_gps_holds_four_satellites_and_no_other():
    samples = np.fromfile(CAPTURE, np.complex64)
    codes = {
        f"{prn}": Periodic(kind="gps_ca", prn=prn, chip_rate=1.023e6, sample_rate=4e6, samples=4000).sampled
        for prn in (29, 25, 12, 2, 8, 15, 5)  # 8 is the strongest of those that are not there
    }
    found = acquire(samples, codes, 4e6)
    assert [one.name for one in found] == ["29", "25", "12", "2"]
    assert np.allclose([one.level for one in found], [21, 20, 14, 11], atol=0.6)
