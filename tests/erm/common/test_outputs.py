"""Output folders and files: one run at a time, and nothing half written."""

import errno
import io
import subprocess
import sys

import h5py
import numpy as np
import pytest

from erm.common.atomic import atomic_path
from erm.common.errors import DataError
from erm.common.hdf5_output import _Output, new_hdf5
from erm.common.outputs import locked


@pytest.mark.skipif(sys.platform == "win32", reason="no locks of folders")
def test_two_runs_in_one_folder_are_refused(tmp_path):
    code = (
        "import sys; from pathlib import Path; from erm.common.outputs import locked\n"
        "with locked(Path(sys.argv[1])): print('held', flush=True); sys.stdin.read()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code, tmp_path / "out"], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == b"held\n"
        with pytest.raises(DataError, match="out: another run is writing into this folder"), locked(tmp_path / "out"):
            pass
        other.kill()  # a lock ends with its process, however it ends
    with locked(tmp_path / "out"):
        pass


def test_a_folder_that_stays_empty_is_removed(tmp_path):
    with pytest.raises(RuntimeError), locked(tmp_path / "a" / "b"):
        raise RuntimeError
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("room", [0, 1, 3000, 100_000])
def test_a_full_disk_is_one_line_and_no_file(tmp_path, room, monkeypatch):
    monkeypatch.setattr(_Output, "_take", lambda self, data: _limited(self, data, room))
    target = tmp_path / "x.h5"

    def write() -> None:
        with atomic_path(target) as temporary, new_hdf5(temporary) as file:
            file["x"] = np.arange(50_000)
            for name in range(20):
                file.attrs[str(name)] = "y" * 100

    with pytest.raises(DataError, match=r"x\.h5: cannot be written \(No space left on device\); is the disk full\?"):
        write()
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("room", [0, 900, 2000])
def test_hdf5_reads_what_it_wrote_on_a_full_disk(tmp_path, room, monkeypatch):
    """It crashes if it does not."""
    monkeypatch.setattr(_Output, "_take", lambda self, data: _limited(self, data, room))
    rng, wrote = np.random.default_rng(room), bytearray()
    with _Output(tmp_path / "x") as output:
        for number in range(1, 200):
            place, length = int(rng.integers(len(wrote) + 1)), int(rng.integers(1, 300))
            output.seek(place)
            assert output.write(bytes([number]) * length) == length
            wrote[place : place + length] = bytes([number]) * length
            assert output.seek(0, io.SEEK_END) == len(wrote)
            output.seek(first := int(rng.integers(len(wrote))))
            read = bytearray(len(wrote) - first)
            assert output.readinto(read) == len(read)
            assert read == wrote[first:]
        assert output.failure is not None
    assert (tmp_path / "x").stat().st_size <= room


def _limited(output, data, room):
    taken = min(len(data), room - output.tell())
    if taken <= 0:
        raise OSError(errno.ENOSPC, "No space left on device")
    return io.FileIO.write(output, data[:taken])


def test_the_same_content_gives_the_same_bytes(tmp_path):
    for name in ("a.h5", "b.h5"):
        with new_hdf5(tmp_path / name) as file:
            iq = file.create_dataset("iq", (3, 100), np.int16)
            for row in range(3):
                iq[row] = row
            file.attrs["name"] = "RX1"
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()
    with h5py.File(tmp_path / "a.h5") as file:
        assert (file["iq"][2] == 2).all()
