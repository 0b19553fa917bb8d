"""HDF5 files that ask for other files, or for more memory than they fill."""

import zlib

import h5py
import numpy as np
import pytest

from erm.common.errors import DataError
from erm.common.gate.hdf5 import Dataset, open_hdf5
from erm.common.gate.heaps import _large_data
from erm.common.gate.limits import allowed


@pytest.fixture
def secret(tmp_path):
    (tmp_path / "secret").mkdir()
    path = tmp_path / "secret" / "other.h5"
    with h5py.File(path, "w") as file:
        file["x"] = np.arange(4.0)
    return path


def external_storage(file, secret):
    plist = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plist.set_external(bytes(secret), 0, 32)
    h5py.h5d.create(file.id, b"x", h5py.h5t.NATIVE_DOUBLE, h5py.h5s.create_simple((4,)), plist)


def external_link(file, secret):
    file["x"] = h5py.ExternalLink(str(secret), "/x")


def virtual(file, secret):
    layout = h5py.VirtualLayout((4,), float)
    layout[:] = h5py.VirtualSource(str(secret), "x", (4,))
    file.create_virtual_dataset("x", layout)


def soft_link(file, secret):
    file["x"] = h5py.SoftLink("/y")


def declared(file, secret):
    file.create_dataset("x", (2**41,), float, chunks=(1024,), compression="gzip")


def twice(file, secret):
    plist = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plist.set_chunk((4,))
    plist.set_deflate(9)
    plist.set_deflate(9)
    h5py.h5d.create(file.id, b"x", h5py.h5t.NATIVE_DOUBLE, h5py.h5s.create_simple((4,)), plist)


@pytest.mark.parametrize(
    ("attack", "line"),
    [
        (external_storage, "x is stored outside, in .*other.h5, which is not read"),
        (external_link, "x is a link to /x of the file .*other.h5, which is not followed"),
        (virtual, "x is a virtual dataset, whose data are in .*other.h5; only files in the folder of a.h5 or below"),
        (soft_link, "x is a link to /y, which is not followed"),
        (declared, r"x declares 16.0 TiB, but the file stores 0 B of it"),
        (twice, "x is packed twice"),
    ],
)
def test_an_attack_is_refused_in_one_line(tmp_path, secret, attack, line):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        attack(file, secret)
    with open_hdf5(path) as file, pytest.raises(DataError, match=rf"a\.h5: {line}") as error:
        file["x"][()]
    assert "\n" not in str(error.value)


def test_virtual_datasets_are_read_from_their_own_folder_when_asked_for(tmp_path, secret):
    with h5py.File(tmp_path / "source.h5", "w") as file:
        file["x"] = np.arange(4.0)
    for name, source in (("in.h5", "source.h5"), ("gone.h5", "gone-source.h5"), ("out.h5", str(secret))):
        with h5py.File(tmp_path / name, "w") as file:
            virtual(file, source)
    with open_hdf5(tmp_path / "in.h5") as file, pytest.raises(DataError, match="if you trust it, allow it with --virt"):
        file["x"]
    for trusted in (False, True):  # what no trust mends is said at once
        for name, line in (("gone.h5", r"gone-source\.h5 is missing"), ("out.h5", "only files in the folder of")):
            with allowed(virtual=trusted), open_hdf5(tmp_path / name) as file, pytest.raises(DataError, match=line):
                file["x"]
    with allowed(virtual=True), open_hdf5(tmp_path / "in.h5") as file:
        assert file["x"][()].tolist() == [0, 1, 2, 3]


def test_what_is_larger_than_the_limit_is_refused_with_the_option_that_raises_it(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["x"] = np.zeros((100, 1000))
    with open_hdf5(tmp_path / "a.h5") as file, allowed(max_bytes=10_000):
        assert file["x"][3].shape == (1000,)
        with pytest.raises(DataError, match=r"x needs 781\.2 KiB, more than the limit of 9\.8 KiB.*--max-memory"):
            file["x"][()]


@pytest.mark.slow
def test_a_circle_of_groups_and_many_groups_are_harmless(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["g/x"] = 1.0
        file["g/again"] = file["/"]
        for i in range(10_001):
            h5py.h5g.create(file.id, b"%d" % i)
    with open_hdf5(tmp_path / "a.h5") as file:
        assert isinstance(file["g/again/g/again/g/x"], Dataset)
        with pytest.raises(DataError, match="has 10002 members; expected at most 10000"):
            list(file)


@pytest.mark.parametrize("samples", [0, 2**20])
def test_texts_whose_list_goes_in_a_circle_are_refused(tmp_path, samples):
    path = tmp_path / "t.h5"
    with h5py.File(path, "w") as file:
        file["before"] = np.zeros(samples)  # large ones are not searched
        file["names"] = ["RX1", "RX2"]
        file.create_dataset("after", data=np.zeros(samples or 8), chunks=(samples // 16 or 1,))
    content = path.read_bytes()
    with open_hdf5(path) as file:
        assert file.dataset("names").texts() == ["RX1", "RX2"]
    heap = content.index(b"GCOL")
    free = heap + 16 + 2 * 24  # after the objects of both texts: a header of 16 bytes and three letters, padded to 8
    for damaged in (
        content[:free] + bytes(16) + content[free + 16 :],  # HDF5 itself reads this for ever
        content[: heap + 8] + bytes(8) + content[heap + 16 :],  # a heap of no length
    ):
        path.write_bytes(damaged)
        line = rf"t\.h5: damaged HDF5 file \(texts at byte {heap}\); make or copy it again"
        with pytest.raises(DataError, match=line):
            open_hdf5(path).__enter__()


def test_deep_groups_are_not_followed_to_their_end(tmp_path):
    """The name of each is as long as its depth: 20 000 of them took minutes."""
    with h5py.File(tmp_path / "d.h5", "w") as file:
        for depth in (20, 200):
            file["/".join("g" * depth + "a")] = np.zeros(2**18)
    assert len(_large_data(str(tmp_path / "d.h5"), (tmp_path / "d.h5").stat().st_size)) == 1


def test_a_letter_of_the_mark_of_an_axis_that_flipped_is_no_crash(tmp_path):
    """HDF5's own test of the mark frees memory twice there, and the process dies."""
    path = tmp_path / "f.h5"
    with h5py.File(path, "w") as file:
        for name in ("axis", "damaged"):
            file[name] = np.zeros(3)
            file[name].make_scale(name)
        kind = file["damaged"].attrs.get_id("CLASS")
        kind.write(np.array(b"DIMENSIOJ_SCALE", "S16"), mtype=kind.get_type())
    with open_hdf5(path) as file:
        assert file["axis"].is_scale
        assert not file["damaged"].is_scale


WHOLE = 8 * 2**20
"""Bytes of a chunk far larger than what is stored of it, so that memory behind that is missed with certainty."""


@pytest.mark.parametrize(
    ("stored", "without", "options", "line"),
    [
        (b"abc", 0, {"fletcher32": True}, f"stores 3 bytes; expected {WHOLE + 4}"),
        (bytes(20), 0, {"fletcher32": True}, f"stores 20 bytes; expected {WHOLE + 4}"),  # its checksum holds
        (bytes(16), 1, {"fletcher32": True}, f"stores 16 bytes; expected {WHOLE}"),
        (bytes(16), 0, {"shuffle": True}, f"stores 16 bytes; expected {WHOLE}"),
        (bytes(16), 1, {"compression": "gzip"}, f"stores 16 bytes; expected {WHOLE}"),
        (zlib.compress(b"short"), 0, {"compression": "gzip"}, f"unpacks to 5 bytes; expected {WHOLE}"),
        (
            zlib.compress(bytes(2 * WHOLE)),
            0,
            {"compression": "gzip"},
            f"unpacks to {WHOLE + 1} bytes; expected {WHOLE}",
        ),
        (b"abcdefgh", 0, {"compression": "gzip"}, "cannot be unpacked"),
        (b"\x08\0\0\0abcd", 0, {"compression": "szip"}, f"unpacks to 8 bytes; expected {WHOLE}"),
        (bytes(4), 0, {"compression": "gzip", "fletcher32": True}, "stores 4 bytes; expected 5 to "),
    ],
)
def test_a_chunk_of_another_length_is_refused_before_hdf5_reads_beyond_it(tmp_path, stored, without, options, line):
    path = tmp_path / "c.h5"
    with h5py.File(path, "w") as file:
        made = file.create_dataset("x", (WHOLE // 8,), "i8", chunks=(WHOLE // 8,), **options)
        made.id.write_direct_chunk((0,), stored, without)
    with open_hdf5(path) as file, pytest.raises(DataError, match=f"x: the chunk at 0 {line}") as error:
        file["x"][:3]
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("options", [{}, {"compression": "gzip"}, {"compression": "lzf"}, {"shuffle": True}])
def test_whole_chunks_are_read_whatever_packs_them(tmp_path, options):
    values = np.arange(7.0 * 9).reshape(7, 9)
    with h5py.File(tmp_path / "c.h5", "w") as file:
        file.create_dataset("x", data=values, chunks=(3, 4), fletcher32=True, **options)
    with open_hdf5(tmp_path / "c.h5") as file:
        held = file["x"]
        for chosen in (slice(2, 5), (slice(None, None, 2), -1), (6, slice(1, 8, 3)), ..., [1, 4], slice(5, 2)):
            assert held[chosen].tolist() == values[chosen].tolist()


@pytest.mark.parametrize("chunks", [None, (2,)])
def test_texts_longer_than_their_file_are_refused_before_memory_is_taken(tmp_path, chunks):
    path = tmp_path / "t.h5"
    names = ["street", "square", "hall"]
    with h5py.File(path, "w") as file:
        made = file.create_dataset("x", data=names, chunks=chunks)
        place = made.id.get_offset() if chunks is None else made.id.get_chunk_info(0).byte_offset
    with open_hdf5(path) as file:
        assert file["x"].texts() == names
    with open(path, "r+b") as file:
        file.seek(place + 16 + 3)  # highest byte of the length of the second text
        file.write(b"\xf0")
    with open_hdf5(path) as file, pytest.raises(DataError, match=f"x: a text of {0xF0 * 2**24 + 6} bytes"):
        file["x"].texts()


def test_more_attributes_than_a_member_can_use_are_refused_at_once(tmp_path):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        for number in range(1001):
            file.attrs[f"a{number}"] = number
    with open_hdf5(path) as file:
        assert file.attrs["a7"] == 7
        with pytest.raises(DataError, match=r"a\.h5: 1001 attributes of one member; expected at most 1000"):
            dict(file.attrs)


def test_an_attribute_of_lists_is_refused_without_reading_it(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        lists = np.empty(1, object)
        lists[0] = np.arange(3, dtype="u1")
        file.attrs.create("units", lists, dtype=h5py.vlen_dtype("u1"))
    with open_hdf5(tmp_path / "a.h5") as file, pytest.raises(DataError, match="attribute units is a list"):
        file.attrs["units"]


@pytest.mark.parametrize("options", [{}, {"compression": "gzip"}])
def test_chunks_of_tables_with_texts_are_whole(tmp_path, options):
    kind = np.dtype([("name", h5py.string_dtype()), ("place", "f8", 3), ("also", h5py.string_dtype(), 2)])
    rows = np.array([("street", 1.0, "a"), ("hall", 2.0, "b"), ("x", 3.0, "c")], kind)
    with h5py.File(tmp_path / "t.h5", "w") as file:
        file.create_dataset("x", data=rows, chunks=(2,), **options)
    with open_hdf5(tmp_path / "t.h5") as file:
        assert file["x"][()]["name"].tolist() == [b"street", b"hall", b"x"]
