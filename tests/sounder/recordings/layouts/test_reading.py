"""Samples are read when they are needed, and an error costs one position."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from erm.common.errors import DataError
from sounder.recordings import foreign
from sounder.recordings.layout import load_layout
from sounder.recordings.recording import Recording

from .captures import IQ, PLAIN


def test_opening_reads_no_sample_and_one_file_serves_all_positions(opened, monkeypatch):
    reads, opens = [], []
    getitem, init = h5py.Dataset.__getitem__, h5py.File.__init__
    monkeypatch.setattr(h5py.Dataset, "__getitem__", lambda self, at: (reads.append(self.name), getitem(self, at))[1])
    monkeypatch.setattr(h5py.File, "__init__", lambda self, *a, **k: init(self, *a, **k) or opens.append(a[0]))
    found, _ = opened({"raw": IQ}, PLAIN)
    assert reads == []
    opens.clear()
    for recording in found:
        recording.captures(0, 0)
    assert reads == ["/raw", "/raw"]
    assert sum(isinstance(name, Path) for name in opens) == 1


def test_a_position_that_cannot_be_used_leaves_the_others(opened):
    found, _ = opened({"raw": IQ}, PLAIN.replace("[32, -50, 1.5]", "[0, 0, 28.4]"))
    assert isinstance(found[0], Recording)
    assert "foreign-01: tx_position equals rx_position" in str(found[1])
    layout = PLAIN.replace("rx = [[31, -46, 1.4], [32, -50, 1.5]]", 'rx = { dataset = "rx" }')
    found, _ = opened({"raw": IQ, "rx": [[np.nan, 0, 0], [1, 2, 3]]}, layout)
    assert "foreign-00: rx_position is [nan, 0.0, 0.0]; expected three finite numbers [m]" in str(found[0])
    assert isinstance(found[1], Recording)


def test_damaged_samples_are_reported_when_they_are_read(tmp_path, opened):
    path = tmp_path / "damaged.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("raw", data=IQ, chunks=(1, *IQ.shape[1:]), fletcher32=True)
        start = file["raw"].id.get_chunk_info(1).byte_offset
    with path.open("r+b") as raw:
        raw.seek(start + 8)
        raw.write(bytes(range(8)))
    found, _ = opened(path, PLAIN)
    assert np.array_equal(found[0].captures(0, 0), IQ[0, 0, 0])
    with pytest.raises(DataError, match=r"damaged\.h5: damaged HDF5 file \(raw: "):
        found[1].captures(0, 0)


def test_the_shipped_layout_reads_a_ray_tracers_file(shared_data: Path, sounder, description):
    plan = load_layout(Path(__file__).parents[4] / "examples" / "layouts" / "raytraced.toml")
    path = shared_data / "raytraced" / "canyon_raw.h5"
    found = foreign.recordings(path, plan, description())
    assert len(found) == 20
    with h5py.File(path) as file:
        for p, recording in enumerate(found):
            assert isinstance(recording, Recording)
            assert recording.missing == []
            assert recording.los == file["rx_los"][p]
            assert np.array_equal(recording.rx_position, file["rx_position"][p])
        # azimuths stand in the second place of the grid's axes there, after the elevations
        assert np.array_equal(found[7].captures(5, 2), file["raw"][7, 2, 5])
    assert found[0].sounder.carrier.frequency == 132e9
    b2b = foreign.back_to_back(path, plan, description())
    assert b2b is not None
    assert b2b.captures.shape == (64, 1022, 2)
