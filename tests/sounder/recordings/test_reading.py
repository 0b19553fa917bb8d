"""Native files return what was written, and samples are read when they are needed."""

import hashlib
import json
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

import h5py
import numpy as np
import pytest
from hypothesis import given, settings

from erm.common.errors import DataError
from sounder.recordings.open import open_recordings
from sounder.recordings.recording import check
from sounder.recordings.writer import write_recording

from ..strategies import recordings
from .files import WAVEFORM


@pytest.mark.slow
def test_a_recording_comes_back_bit_for_bit(path, recording):
    (back,) = open_recordings(path)
    for a, e in np.ndindex(3, 2):
        captures = back.captures(a, e)
        assert captures.dtype == np.int16
        assert captures.shape == (3, 254, 2)
        assert np.array_equal(captures, recording.captures(a, e))
        assert np.array_equal(back.captures(a, e, slice(1, 2)), recording.captures(a, e)[1:2])
    for name in ("azimuth", "elevation", "tx_position", "rx_position", "agc_gain", "valid", "time"):
        assert np.array_equal(getattr(back, name), getattr(recording, name)), name
    for name in ("name", "los", "scale_factor", "snapshots", "sounder"):
        assert getattr(back, name) == getattr(recording, name), name
    assert back.source == path
    assert back.missing == []


@settings(max_examples=12, deadline=None)
@given(recording=recordings())
def test_any_recording_comes_back_bit_for_bit_or_is_refused(recording):
    """Directions that were not recorded have no captures."""
    with TemporaryDirectory() as folder, suppress(DataError):
        check(recording, 1022)
        write_recording(recording, Path(folder) / "r.h5", history="test")
        (back,) = open_recordings(Path(folder) / "r.h5")
        for a, e in np.argwhere(recording.valid):
            assert np.array_equal(back.captures(a, e), recording.captures(a, e))
        for name in ("azimuth", "elevation", "tx_position", "rx_position", "agc_gain", "valid"):
            np.testing.assert_array_equal(getattr(back, name), getattr(recording, name), err_msg=name)  # or both NaN
        assert (back.scale_factor, back.snapshots) == (recording.scale_factor, recording.snapshots)


def test_the_same_recording_gives_the_same_bytes(path, recording):
    again = path.with_name("again.h5")
    write_recording(recording, again, history="test")
    assert again.read_bytes() == path.read_bytes()


def test_reading_leaves_the_file_as_it_was_and_the_samples_cannot_be_written(path):
    before = hashlib.sha256(path.read_bytes()).digest(), path.stat().st_mtime_ns
    (back,) = open_recordings(path)
    captures = back.captures(0, 0)
    with pytest.raises(ValueError, match="read-only"):
        captures[0] = 0
    assert (hashlib.sha256(path.read_bytes()).digest(), path.stat().st_mtime_ns) == before


@pytest.mark.parametrize("storage", [{}, {"chunks": (1, 1, 1000, 254, 2)}])
def test_opening_reads_no_sample(path, storage, monkeypatch):
    # 4 GB of samples that are not there, as a sparse file: reading them would be noticed
    snapshots = 6 * 10**5
    with h5py.File(path, "r+") as file:
        scale = file["iq"].attrs["scale_factor"]
        del file["iq"], file.attrs["members"]
        iq = file.create_dataset("iq", (3, 2, snapshots, 254, 2), np.int16, **storage)
        iq.attrs["scale_factor"] = scale
        iq[2, 1, snapshots - 1] = 7  # gives the dataset its place in the file
        if storage:  # a thousandth of what is declared is there: less would be refused
            iq[:2, :, 0] = 7
    asked = []
    getitem = h5py.Dataset.__getitem__
    monkeypatch.setattr(h5py.Dataset, "__getitem__", lambda self, at: (asked.append(self.name), getitem(self, at))[1])
    (back,) = open_recordings(path)
    assert back.snapshots == snapshots
    assert "/iq" not in asked
    assert (back.captures(2, 1, slice(-1, None)) == 7).all()
    assert ("/iq" in asked) == bool(storage)  # what stands in one piece is read without HDF5


def test_samples_in_one_piece_and_in_chunks_are_the_same(path, recording):
    with h5py.File(path, "r+") as file:
        samples, scale = file["iq"][()], file["iq"].attrs["scale_factor"]
        del file["iq"]
        file.create_dataset("iq", data=samples, chunks=(1, 1, 3, 254, 2), compression="gzip")
        file["iq"].attrs["scale_factor"] = scale
    (back,) = open_recordings(path)
    assert np.array_equal(back.captures(1, 0), recording.captures(1, 0))


def test_what_may_be_absent_is_assumed(path):
    with h5py.File(path, "r+") as file:
        for name in ("agc_gain", "valid", "time"):
            del file[name]
        del file.attrs["los"], file.attrs["position"], file.attrs["members"]  # as made by hand
    (back,) = open_recordings(path)
    assert (back.name, back.los, back.time) == ("p1", -1, None)
    assert np.array_equal(back.agc_gain, np.zeros((3, 2)))
    assert back.valid.all()


def test_directions_not_recorded_are_missing(path):
    with h5py.File(path, "r+") as file:
        file["valid"][1, 0] = 0
        file["agc_gain"][1, 0] = np.nan  # nobody knows
    (back,) = open_recordings(path)
    assert back.missing == [(90.0, -9.0)]


def test_a_scan_that_is_wider_than_the_recording_leaves_directions_missing(path, description):
    # the same directions, counted from -180
    wider = description(waveform=WAVEFORM, scan={"azimuth": [-160.0, 0.0, 45.0, 90.0], "elevation": [-9.0, 9.0]})
    (back,) = open_recordings(path, wider)
    assert back.missing == [(45.0, -9.0), (45.0, 9.0)]


def test_provenance_is_stored_in_the_file(path, recording):
    with h5py.File(path) as file:
        attributes = dict(file.attrs)
        assert file["iq"].attrs["units"] == "mW0.5"
        assert [dim.label for dim in file["iq"].dims] == ["azimuth", "elevation", "snapshot", "sample", "iq"]
    assert {"Conventions", "title", "source", "history", "software_version", "input_sha256"} <= attributes.keys()
    assert json.loads(attributes["sounder"])["name"] == recording.sounder.name


@pytest.mark.parametrize(
    "wanted", [slice(None, None, 2), slice(1, None), slice(None, None, -1), slice(3, 3), slice(-1, None)]
)
def test_any_slice_of_snapshots_is_what_numpy_would_take(path, wanted):
    (back,) = open_recordings(path)
    assert np.array_equal(back.captures(1, 1, wanted), np.asarray(back.captures(1, 1))[wanted])


def test_attributes_of_other_languages_are_the_same_recording(path, recording):
    with h5py.File(path, "r+") as file:
        for node in (file, file["iq"]):
            for name, value in list(node.attrs.items()):
                node.attrs[name] = np.bytes_(value.encode()) if isinstance(value, str) else np.array([value])
    (back,) = open_recordings(path)
    assert (back.name, back.los, back.scale_factor) == (recording.name, recording.los, recording.scale_factor)
    assert back.sounder == recording.sounder
