"""Checksums of chunks: those that HDF5 writes."""

import sys

import h5py
import numpy as np
import pytest

from sounder.recordings.checksum import checksum_holds


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("count", [1, 255, 256, 257, 5000])
def test_chunks_of_hdf5_hold_and_one_wrong_bit_is_seen(tmp_path, monkeypatch, count, compiled):
    if compiled:
        import numba  # noqa: F401
    else:
        monkeypatch.delitem(sys.modules, "numba", raising=False)
    rng = np.random.default_rng(count)
    rows = np.array([rng.integers(-(2**15), 2**15, count), np.zeros(count), np.full(count, -1)], np.int16)
    with h5py.File(tmp_path / "file.h5", "w") as file:
        data = file.create_dataset("x", data=rows, chunks=(1, count), fletcher32=True).id
        chunks = [bytearray(data.read_direct_chunk((k, 0))[1]) for k in range(len(rows))]
    for chunk in chunks:
        assert checksum_holds(bytes(chunk))
        chunk[rng.integers(len(chunk))] ^= 1 << rng.integers(8)
        assert not checksum_holds(bytes(chunk))
