"""Formats of plain samples agree with independent readers to the last bit, and damaged files are one line."""

import io
import json
import tarfile
from pathlib import Path

import numpy as np
import pytest

from erm.common.errors import DataError
from erm.common.gate.limits import allowed
from erm.common.gate.plain import PlainNumbers, Rows
from sounder.processing.convert import convert_file
from sounder.processing.summary import describe_file
from sounder.recordings.formats import touchstone_set
from sounder.recordings.formats.find import content_of
from sounder.recordings.open import open_recordings

ROHDE_SCHWARZ = Path(__file__).parents[4] / "shared" / "data" / "instrument" / "rohde-schwarz"
HEADER = 'dtype = "int16"\nsamples = "complex"\nbyte_order = "big"\nheader = 8'
RNG = np.random.default_rng(3)
SAMPLES = RNG.integers(-(2**15), 2**15, (40, 2), dtype=np.int16)


def iq_tar(path: Path, data: bytes, **changes: str | None) -> Path:
    tags = {
        "Samples": "40",
        "Clock": "1e6",
        "Format": "complex",
        "DataType": "int16",
        "ScalingFactor": "2",
        "DataFilename": "a.complex.int16",
    } | changes
    text = "".join(f"<{name}>{value}</{name}>" for name, value in tags.items() if value is not None)
    xml = f"<RS_IQ_TAR_FileFormat>{text}</RS_IQ_TAR_FileFormat>".encode()
    with tarfile.open(path, "w") as archive:
        for name, content in (("a.complex.int16", data), ("a.xml", xml)):
            member = tarfile.TarInfo(name)
            member.size = len(content)
            archive.addfile(member, io.BytesIO(content))
    return path


def sigmf(path: Path, data: bytes, datatype: str, **of_all) -> Path:
    path.with_suffix(".sigmf-data").write_bytes(data)
    described = {"core:datatype": datatype, "core:sample_rate": 1e6, "core:version": "1.2.0"} | of_all
    path.write_text(json.dumps({"global": described, "captures": [{"core:frequency": 28e9}], "annotations": []}))
    return path


def raw(path: Path, data: bytes, sidecar: str) -> Path:
    path.write_bytes(data)
    path.with_name(path.name + ".toml").write_text(sidecar)
    return path


def test_a_piece_of_plain_numbers_is_what_numpy_would_take(tmp_path):
    whole = np.arange(2 * 3 * 4 * 5).reshape(2, 3, 4, 5)
    path = tmp_path / "numbers"
    path.write_bytes(b"head" + whole.astype(">i4").tobytes())
    stored = PlainNumbers(path, np.dtype(">i4"), whole.shape, 4)
    flat = Rows(PlainNumbers(path, np.dtype(">i4"), (whole.size,), 4), whole.shape, 0, 5)
    for index in [(), 1, (-1, slice(2, 0, -1)), (0, 2, slice(1, 9, 2)), (slice(None), 1), (1, 1, slice(3, 3))]:
        wanted = whole[index]
        for found in (stored[index], flat[index]):
            assert found.dtype == np.int32
            assert np.array_equal(found, wanted), index
    spaced = Rows(whole.reshape(-1), (2, 3, 3), 10, 18)  # captures of 3, 18 samples apart, from sample 10
    assert np.array_equal(spaced[1, 1:], whole.reshape(-1)[[[82, 83, 84], [100, 101, 102]]])
    with allowed(max_bytes=16), pytest.raises(DataError, match="more than the limit"):
        stored[0]


def test_integers_of_every_format_come_back_bit_for_bit(tmp_path):
    little, big = SAMPLES.astype("<i2").tobytes(), SAMPLES.astype(">i2").tobytes()
    files = [
        iq_tar(tmp_path / "a.iq.tar", little),
        iq_tar(tmp_path / "renamed.bin", little),  # detected by content
        sigmf(tmp_path / "a.sigmf-meta", big, "ci16_be"),
        raw(tmp_path / "a.dat", b"12345678" + big, HEADER),
    ]  # fmt: skip
    for file in files:
        found = content_of(file)["samples"]
        assert (found.shape, found[3:5].dtype) == ((40, 2), np.int16), file
        assert np.array_equal(found[()], SAMPLES), file
    assert content_of(files[0]).attrs["scale_factor"] == pytest.approx(2 * np.sqrt(1e3 / 50))  # 2 V in 50 ohm
    blocks = raw(tmp_path / "b.iqw", SAMPLES.T.astype("<f4").tobytes(), 'dtype = "float32"\nsamples = "blocks"')
    assert np.array_equal(content_of(blocks)["i"][()], SAMPLES[:, 0])
    assert np.array_equal(content_of(blocks)["q"][()], SAMPLES[:, 1])
    floats = SAMPLES.astype("<f4").view("<c8")[:, 0]
    both = raw(tmp_path / "c.bin", floats.tobytes(), 'dtype = "float32"\nsamples = "complex"\nshape = [4, 10]')
    assert np.array_equal(content_of(both)["samples"][1], floats[10:20])
    assert ("kind", "SigMF") in describe_file(files[2])


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"Samples": None}, "the description has no Samples"),
        ({"Samples": "41"}, "has 160 bytes; the description says 164"),
        ({"NumberOfChannels": "--"}, "NumberOfChannels is --; expected a whole number"),
        ({"Format": "polar"}, "Format polar, DataType int16; expected complex or real"),
        ({"DataFilename": "../x"}, "names the samples ../x, which the archive has not"),
        ({"Clock": "fast"}, "Clock is fast; expected a positive number"),
        ({"Clock": "&boom;"}, "is no XML"),
    ],
)
def test_an_archive_that_contradicts_itself_is_refused_with_the_reason(tmp_path, changes, expected):
    with pytest.raises(DataError) as error:
        content_of(iq_tar(tmp_path / "a.iq.tar", SAMPLES.tobytes(), **changes))
    assert expected in str(error.value)


@pytest.mark.parametrize(
    ("datatype", "of_all", "expected"),
    [
        ("ci16", {}, "core:datatype is ci16; expected one such as ci16_le"),
        ("cf16_le", {}, "core:datatype is cf16_le"),
        ("ci16_le", {"core:num_channels": 3}, "160 bytes of samples; expected a multiple of 12"),
        ("ci16_le", {"core:sha512": "0"}, "the samples are not those of core:sha512"),
    ],
)
def test_metadata_that_do_not_fit_the_samples_are_refused(tmp_path, datatype, of_all, expected):
    with pytest.raises(DataError) as error:
        content_of(sigmf(tmp_path / "a.sigmf-meta", SAMPLES.tobytes(), datatype, **of_all))
    assert expected in str(error.value)


def test_plain_samples_of_another_size_than_described_are_refused(tmp_path):
    path = raw(tmp_path / "a.bin", SAMPLES.tobytes()[:-2], 'dtype = "int16"\nsamples = "complex"')
    with pytest.raises(DataError, match=r"158 bytes behind the header; a\.bin\.toml says 39 samples of 4 bytes, 156"):
        content_of(path)


@pytest.mark.skipif(not ROHDE_SCHWARZ.is_dir(), reason="the files of instruments are beside the clone only")
def test_archives_of_instruments_hold_the_same_samples_as_the_plain_file(tmp_path):
    analyser = content_of(ROHDE_SCHWARZ / "FromFSW_1ch_WithPreview.iq.tar")
    plain = np.fromfile(ROHDE_SCHWARZ / "FromFSW_1ch_asiqw.iqw", "<f4").reshape(2, -1)  # all I, then all Q
    assert np.array_equal(analyser["samples"][()], (plain[0] + 1j * plain[1]).astype(np.complex64))
    assert (analyser.attrs["frequency"], analyser.attrs["sample_rate"]) == (13.25e9, 32e6)
    assert content_of(ROHDE_SCHWARZ / "cyrillic_name.iq.tar")["samples"].shape == (256289,)
    both = content_of(ROHDE_SCHWARZ / "dummy_multi_channel.iq.tar")["samples"][()]
    assert np.array_equal(both, np.array([[0.2 + 0.4j, 0.6 + 0.8j]] * 2, np.complex64))
    for name in ("CorruptTarHeader", "MissingXML", "MissingTag", "WrongValueFormat"):
        with pytest.raises(DataError) as error:
            content_of(ROHDE_SCHWARZ / f"{name}.iq.tar")
        assert "\n" not in str(error.value)


def test_a_recording_comes_back_from_sigmf_with_all_that_it_knows(tmp_path, path, recording):
    outcome = convert_file(path, tmp_path / "out.sigmf-meta")
    assert outcome.failures == []
    for name in ("out.sigmf-meta", "out.sigmf-data"):
        [back] = open_recordings(tmp_path / name)
        assert np.array_equal(back.captures(2, 1, slice(1, 3)), recording.captures(2, 1, slice(1, 3)))
        for key in ("azimuth", "elevation", "agc_gain", "valid", "time", "tx_position", "rx_position"):
            assert np.array_equal(getattr(back, key), getattr(recording, key)), key
        for key in ("name", "los", "scale_factor", "snapshots", "sounder", "kind"):
            assert getattr(back, key) == getattr(recording, key), key
    meta = json.loads((tmp_path / "out.sigmf-meta").read_text())
    assert meta["captures"][0]["core:frequency"] == recording.sounder.carrier.frequency
    assert [len(meta["annotations"]), meta["annotations"][1]["core:sample_start"]] == [6, 3 * 254]


def test_a_line_of_sight_that_is_none_is_refused_in_sigmf(tmp_path, path):
    convert_file(path, tmp_path / "out.sigmf-meta")
    meta = tmp_path / "out.sigmf-meta"
    described = json.loads(meta.read_text())
    described["global"]["sounder:recording"]["los"] = 10**30
    meta.write_text(json.dumps(described))
    with pytest.raises(DataError, match=r"out\.sigmf-meta: los is 1e.30; expected 1 \(line of sight\)"):
        open_recordings(meta)


def test_the_metadata_of_sigmf_satisfy_its_own_library(tmp_path, path):
    library = pytest.importorskip("sigmf")
    convert_file(path, tmp_path / "out.sigmf-meta")
    read = library.fromfile(str(tmp_path / "out.sigmf-meta"))
    read.validate()
    assert read.sample_count == 3 * 2 * 3 * 254


def test_channels_of_tdms_are_those_that_were_written(tmp_path):
    library = pytest.importorskip("nptdms")
    with library.TdmsWriter(str(tmp_path / "a.tdms")) as writer:
        channels = [library.ChannelObject("scan", name, SAMPLES[:, k]) for k, name in enumerate("IQ")]
        writer.write_segment([library.RootObject({"rate": 1e6}), *channels])
    found = content_of(tmp_path / "a.tdms")
    assert np.array_equal(found["scan/I"], SAMPLES[:, 0])
    assert np.array_equal(found["scan/Q"], SAMPLES[:, 1])
    assert found.attrs["rate"] == 1e6


def test_a_folder_of_touchstone_files_is_a_grid(tmp_path):
    frequency, values = np.array([27e9, 28e9, 29e9]), RNG.normal(size=(2, 2, 3, 2))
    for a, e in ((0, 0), (0, 1), (1, 0)):
        lines = [f"{f:.0f} 0 0 {x!r} {y!r} 0 0 0 0" for f, (x, y) in zip(frequency, values[a, e].tolist(), strict=True)]
        name = f"az{90 * a:03d}_el{15 * e - 7.5:+.1f}.s2p".replace(".5", "p5")
        (tmp_path / name).write_text("# Hz S RI R 50\n" + "\n".join(lines) + "\n")
    (tmp_path / "notes.txt").write_text("rain")
    found = touchstone_set.content(tmp_path, "az{azimuth}_el{elevation}.s2p")
    assert (found["azimuth"].tolist(), found["elevation"].tolist()) == ([0, 90], [-7.5, 7.5])
    assert np.array_equal(found["s21"][1, 0], values[1, 0] @ [1, 1j])
    assert np.isnan(found["s21"][1, 1]).all()
    assert len(found.files) == 3
    with pytest.raises(DataError, match="no file is named as"):
        touchstone_set.content(tmp_path, "{azimuth}.s2p")
