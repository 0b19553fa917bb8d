"""MATLAB files are parsed apart from this process."""

import struct

import numpy as np
import pytest
import scipy.io

from erm.common.errors import DataError
from erm.common.gate.limits import allowed
from erm.common.gate.matlab import read_matlab


@pytest.mark.slow
def test_numbers_texts_and_structures_are_those_of_scipy(tmp_path):
    path = tmp_path / "a.mat"
    scipy.io.savemat(
        path, {"raw": np.arange(6).reshape(2, 3), "c": np.array([1j]), "s": {"who": "us", "t": {"z": 1.5}}}
    )
    found = read_matlab(path)
    assert found["raw"].tolist() == [[0, 1, 2], [3, 4, 5]]
    assert (found["c"].item(), found["s/who"].item(), found["s/t/z"].item()) == (1j, "us", 1.5)
    scipy.io.savemat(path, {"raw": np.zeros(9000)}, do_compression=True)  # 72 kB in some hundred bytes
    with allowed(max_bytes=10_000), pytest.raises(DataError, match=r"a\.mat: needs 70\.3 KiB.*--max-memory"):
        read_matlab(path)


def element(kind: int, data: bytes) -> bytes:
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


def matrix(name: bytes, content: bytes, kind: int) -> bytes:
    head = element(6, struct.pack("<II", kind, 0)) + element(5, struct.pack("<2i", 1, 1)) + element(1, name)
    return element(14, head + content)


@pytest.mark.slow
def test_cells_in_cells_do_not_end_this_process(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {})
    cell = matrix(b"", element(9, bytes(8)), 6)
    for _ in range(20_000):
        if len(cell) < 1_500_000:
            cell = matrix(b"", cell, 1)
    path = tmp_path / "deep.mat"
    path.write_bytes((tmp_path / "a.mat").read_bytes()[:128] + matrix(b"raw", cell, 1))
    with pytest.raises(DataError, match=r"deep\.mat: .*damaged"):
        read_matlab(path)
