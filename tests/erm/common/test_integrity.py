"""Every changed bit of a dataset is found, and every member that is lost."""

import json

import h5py
import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

from erm.common.errors import DataError
from erm.common.gate.hdf5 import open_hdf5
from erm.common.integrity import check_members, checksummed
from erm.common.storage import open_group, write_product

TABLE = xr.Dataset(
    {
        "delay": ("path", np.linspace(1e-8, 1e-7, 9)),
        "position": ("path", ["RX1"] * 9),
        "daps": (("azimuth", "delay_bin"), np.arange(60.0, dtype=np.float32).reshape(6, 10)),
        "cir": (("azimuth", "delay_bin"), np.full((6, 10), 1 - 2j, np.complex64)),
    }
)


@pytest.fixture
def product(tmp_path):
    path = tmp_path / "p.h5"
    write_product({"/": TABLE, "/mpc": TABLE[["delay"]]}, path)
    return path


def test_what_was_written_is_read_and_right(product):
    xr.testing.assert_identical(open_group(product), TABLE)
    with open_hdf5(product) as file:
        assert {state for _, state in check_members(file)} == {"right"}


def chunks(path):
    """Places of all numbers in a file."""
    places = []

    def note(name, node):
        if isinstance(node, h5py.Dataset) and node.chunks and node.dtype.kind != "O":
            node.id.chunk_iter(lambda info: places.append((name, info.byte_offset, info.size)))

    with h5py.File(path) as file:
        file.visititems(note)
    return places


@pytest.mark.slow
@settings(max_examples=10, deadline=None)
@given(data=st.data())
def test_every_changed_bit_of_a_dataset_is_found(data, tmp_path_factory):
    path = tmp_path_factory.mktemp("bit") / "p.h5"
    write_product({"/": TABLE, "/mpc": TABLE[["delay"]]}, path)
    name, offset, size = data.draw(st.sampled_from(chunks(path)))
    content = bytearray(path.read_bytes())
    content[offset + data.draw(st.integers(0, size - 1))] ^= 1 << data.draw(st.integers(0, 7))
    path.write_bytes(content)
    group, _, member = name.rpartition("/")
    with pytest.raises(DataError, match=rf"p\.h5: damaged HDF5 file .*checksum does not hold|{member}"):
        open_group(path, f"/{group}")
    with open_hdf5(path) as file:
        assert [n for n, state in check_members(file) if state != "right"] == [name]


def test_a_lost_member_and_one_of_another_type_are_missed(product):
    with h5py.File(product, "r+") as file:
        file.move("daps", "dabs")
    with pytest.raises(DataError, match=r"p\.h5: damaged: daps is missing; copy the file again"):
        open_group(product)
    open_group(product, "/mpc")  # nothing of it is lost
    with h5py.File(product, "r+") as file:
        del file["dabs"]
        file["daps"] = np.zeros((6, 10))
    with pytest.raises(DataError, match=r"daps is <f8 \(6,10\), written as <f4 \(6,10\)"):
        open_group(product)
    with h5py.File(product, "r+") as file:
        del file["mpc/delay"]
        file["mpc/delay"] = np.zeros(0)
    with pytest.raises(DataError, match=r"mpc/delay is <f8 \(0,\), written as <f8 \(9,\)"):
        open_group(product, "/mpc")


def test_lists_of_members_without_shapes_are_read(product):
    with h5py.File(product, "r+") as file:
        listed = json.loads(file.attrs["members"])
        file.attrs["members"] = json.dumps({name: kind.partition(" ")[0] for name, kind in listed.items()})
    xr.testing.assert_identical(open_group(product), TABLE)


def test_data_that_were_changed_on_purpose_are_accepted(product):
    with h5py.File(product, "r+") as file:
        file["daps"][2, 3] = -1.0
    assert open_group(product)["daps"].values[2, 3] == -1


@pytest.mark.parametrize(("shape", "rows"), [((72, 3), 72), ((10**6, 8), 2**20 // 64), ((3, 10**7), 1)])
def test_chunks_are_whole_rows_of_a_megabyte(shape, rows):
    assert checksummed(shape, 8)["chunks"] == (rows, *shape[1:])
