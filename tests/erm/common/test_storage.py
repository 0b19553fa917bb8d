"""Files appear whole or not at all, and say where they came from."""

import contextlib
import hashlib
import itertools
import json
import sys
import threading
from pathlib import Path

import h5netcdf
import h5py
import numpy as np
import pytest
import xarray as xr

from erm import __version__
from erm.common.errors import DataError
from erm.common.storage import open_group, provenance, sha256, write_product


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_changed_file_has_another_sum(tmp_path):
    path = tmp_path / "x"
    path.write_bytes(b"one")
    assert sha256(path) == hashlib.sha256(b"one").hexdigest()
    path.write_bytes(b"other")
    assert sha256(path) == hashlib.sha256(b"other").hexdigest()


def test_provenance_names_software_inputs_and_options_and_no_time(tmp_path):
    (tmp_path / "in.h5").write_bytes(b"input")
    first = provenance("Title", "a step", inputs=[tmp_path / "in.h5"], options={"b": 1, "a": tmp_path})
    assert first == provenance("Title", "a step", inputs=[tmp_path / "in.h5"], options={"a": tmp_path, "b": 1})
    assert first["Conventions"].startswith("CF-")
    assert (first["title"], first["history"], first["software_version"]) == ("Title", "a step", __version__)
    assert __version__ in first["source"]
    assert json.loads(first["input_sha256"]) == {"in.h5": hashlib.sha256(b"input").hexdigest()}
    assert json.loads(first["processing_options"]) == {"a": str(tmp_path), "b": 1}


def groups(seed: int = 1) -> dict[str, xr.Dataset]:
    rng = np.random.default_rng(seed)
    path = ("path", rng.random(3), {"units": "s"})
    cir = (("azimuth", "delay"), (rng.random((2, 5)) + 1j * rng.random((2, 5))).astype(np.complex64))
    return {
        "/": xr.Dataset({"x": path}, attrs={"title": "T"}),
        "/none": xr.Dataset({"delay": ("mpc", np.zeros(0))}),
        "/cir": xr.Dataset({"cir": cir}),
    }


def test_a_product_comes_back_group_by_group(tmp_path):
    write_product(groups(), tmp_path / "p.h5")
    for name, dataset in groups().items():
        xr.testing.assert_identical(open_group(tmp_path / "p.h5", name), dataset)


@pytest.mark.parametrize("writer", ["this", "xarray"])
def test_a_group_is_read_as_xarray_reads_it(tmp_path, writer):
    """The engine h5netcdf is the reference, for files of this software and of xarray."""
    dataset = xr.Dataset(
        {
            "used": ("mpc", [True, False, True], {"flag_values": np.array([0, 1], np.int8)}),
            "share": (("mpc", "end"), np.array([[1, np.nan], [2, 3], [4, 5]], np.float32), {"one": np.array([7])}),
            "text": ("mpc", np.array(["a", "", "\N{GREEK SMALL LETTER TAU}"])),
            "height": ((), 2.5),
        },
        coords={"end": ["tx", "rx"], "delay": ("mpc", [1e-9, 2e-9, 3e-9], {"units": "s"})},
        attrs={"title": "T", "frequency": 132e9},
    )
    if writer == "this":
        write_product({"/": dataset}, tmp_path / "p.h5")
    else:
        dataset.to_netcdf(tmp_path / "p.h5", engine="h5netcdf")
    read = open_group(tmp_path / "p.h5")
    with xr.open_dataset(tmp_path / "p.h5", engine="h5netcdf") as expected:
        expected.attrs.pop("members", None)
        xr.testing.assert_identical(read, expected.load())
    assert {name: one.dtype for name, one in read.variables.items()} == {
        name: one.dtype for name, one in expected.variables.items()
    }


ODD = (
    np.nan,
    -1,
    np.inf,
    1e308,
    "",
    "days since 2000-01-01",
    b"\xff",
    np.zeros((3, 3)),
    np.zeros(0),
    1 + 2j,
    h5py.Empty("f8"),
)
CODED = ("_FillValue", "missing_value", "scale_factor", "add_offset", "units", "dtype", "coordinates", "_Encoding")


@pytest.mark.slow
@pytest.mark.parametrize("name", CODED)
def test_an_odd_attribute_is_refused_or_does_no_harm_when_it_is_written_again(tmp_path, name):
    for values, odd in itertools.product((np.arange(3.0), np.arange(3), np.array(["a", "b", "c"], object)), ODD):
        with h5py.File(tmp_path / "p.h5", "w") as file:
            file["v"] = values
            file["v"].attrs[name] = odd
        with contextlib.suppress(DataError):
            read = open_group(tmp_path / "p.h5")
            write_product({"/": read}, tmp_path / "q.h5")
            xr.testing.assert_equal(open_group(tmp_path / "q.h5"), read)


def test_a_wrong_fill_value_is_refused_by_name(tmp_path):
    with h5py.File(tmp_path / "p.h5", "w") as file:
        file["v"] = np.arange(3.0)
        file["v"].attrs["_FillValue"] = np.zeros((2, 2))
    line = r"p\.h5: attribute _FillValue of v is array\(\[\[0\., 0\.\], \[0\., 0\.\]\]\); expected one number"
    with pytest.raises(DataError, match=line):
        open_group(tmp_path / "p.h5")


@pytest.mark.parametrize("wrong", [np.zeros((3, 3)), "many", np.nan])
def test_a_figure_of_a_product_is_one_number_or_refused_by_name(tmp_path, wrong):
    write_product({"/": xr.Dataset(attrs={"independent_samples": wrong})}, tmp_path / "p.h5")
    with pytest.raises(DataError, match=r"p\.h5: attribute independent_samples is .*; expected a finite number"):
        open_group(tmp_path / "p.h5")


def test_axes_are_known_from_their_scales_alone(tmp_path):
    """A damaged length in the lists of the variables costs HDF5 seconds to read."""
    write_product(groups(), tmp_path / "p.h5")
    with h5py.File(tmp_path / "p.h5", "r+") as file:
        del file["x"].attrs["DIMENSION_LIST"], file["cir/cir"].attrs["DIMENSION_LIST"]
    for name, dataset in groups().items():
        xr.testing.assert_identical(open_group(tmp_path / "p.h5", name), dataset)


def test_a_file_of_groups_that_are_nested_deeply_is_read(tmp_path):
    """HDF5 crashes where it looks for the name of a reference in such groups."""
    write_product(groups(), tmp_path / "p.h5")
    with h5py.File(tmp_path / "p.h5", "r+") as file:
        node = file.create_group("deep").id
        for _ in range(20_000):
            node = h5py.h5g.create(node, b"d")
    xr.testing.assert_identical(open_group(tmp_path / "p.h5", "/"), groups()["/"])


def test_whole_numbers_have_a_whole_number_in_place_of_what_is_missing(tmp_path):
    with h5py.File(tmp_path / "p.h5", "w") as file:
        file["v"] = np.arange(3)
        file["v"].attrs["_FillValue"] = np.nan
    with pytest.raises(DataError, match=r"p\.h5: attribute _FillValue of v is nan; expected a whole number"):
        open_group(tmp_path / "p.h5")


def test_axes_without_a_name_get_one(tmp_path):
    with h5py.File(tmp_path / "p.h5", "w") as file:
        file["a"], file["b"] = np.zeros((3, 3, 3)), np.zeros(2)
    assert open_group(tmp_path / "p.h5").sizes == {"axis_3": 3, "axis_3_1": 3, "axis_3_2": 3, "axis_2": 2}


def test_the_same_groups_are_the_same_bytes(tmp_path):
    for name in ("a.h5", "b.h5"):
        write_product(groups(), tmp_path / name)
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()
    write_product(groups(seed=2), tmp_path / "b.h5")
    assert (tmp_path / "a.h5").read_bytes() != (tmp_path / "b.h5").read_bytes()


@pytest.mark.slow
def test_a_thread_that_looks_on_changes_no_byte(tmp_path):
    """dask's workers sample what their threads are doing, which keeps Python's objects alive a moment longer."""
    stop = threading.Event()

    def sample():
        frames = sys._current_frames()
        while not stop.wait(5e-4):
            frames = sys._current_frames()
        frames.clear()

    coordinates = {"azimuth": [0.0, 10.0], "delay": np.arange(5.0), "name": ("position", ["RX1"])}
    scan = {"/": groups()["/cir"].assign_coords(coordinates), **{f"/{i}": groups()["/"] for i in range(5)}}
    watcher = threading.Thread(target=sample)
    watcher.start()
    try:
        for number in range(20):
            write_product(scan, tmp_path / f"{number}.h5")
    finally:
        stop.set()
        watcher.join()
    assert len({(tmp_path / f"{number}.h5").read_bytes() for number in range(20)}) == 1


def test_a_product_has_the_dimensions_of_netcdf(tmp_path):
    """Scales with the names that the netCDF library looks for, attached to every axis."""
    write_product({"/": groups()["/cir"].assign_coords(azimuth=[0.0, 10.0])}, tmp_path / "p.h5")
    with h5py.File(tmp_path / "p.h5") as file:
        assert [axis[0].name for axis in file["cir"].dims] == ["/azimuth", "/delay"]
        assert file["azimuth"].attrs["CLASS"] == b"DIMENSION_SCALE"
        assert file["azimuth"].attrs["NAME"] == b"azimuth"
        # the text and the size, %10d, that the format prescribes for a dimension without coordinates
        assert file["delay"].attrs["NAME"] == b"This is a netCDF dimension but not a netCDF variable.         5"
    with h5netcdf.File(tmp_path / "p.h5") as file:
        assert {name: dimension.size for name, dimension in file.dimensions.items()} == {"azimuth": 2, "delay": 5}
        assert list(file.variables) == ["azimuth", "cir"]


def test_a_product_that_cannot_be_written_whole_is_not_there(tmp_path):
    spoiled = {**groups(), "/bad": xr.Dataset({"x": ("y", np.array([object()]))})}
    with pytest.raises((TypeError, ValueError)):
        write_product(spoiled, tmp_path / "p.h5")
    assert names(tmp_path) == []


def test_a_product_is_closed_after_reading(tmp_path):
    write_product(groups(), tmp_path / "p.h5")
    loaded = open_group(tmp_path / "p.h5")
    (tmp_path / "p.h5").unlink()
    assert loaded["x"].values.size == 3


@pytest.mark.parametrize(
    ("content", "group", "told"),
    [
        (None, "/", "no such file"),
        (b"text", "/", "not an HDF5 file; expected a product of this software"),
        (b"", "/", "is empty; make or copy it again"),
        ("product", "/mpc", "holds cir, none, path, x and has no group /mpc; expected a product of this software"),
        ("captures", "/mpc", "is a recording and has no group /mpc; expected a product of this software"),
    ],
)
def test_what_is_no_product_is_told(tmp_path, content, group, told):
    path = tmp_path / "p.h5"
    if content == "product":
        write_product(groups(), path)
    elif content == "captures":
        write_product({"/": xr.Dataset({"iq": ("sample", np.zeros(3))}, attrs={"kind": "recording"})}, path)
    elif content is not None:
        path.write_bytes(content)
    with pytest.raises(DataError) as error:
        open_group(path, group)
    assert str(error.value) == f"{path}: {told}"


@pytest.mark.parametrize("share", [0.2, 0.5, 0.9])
def test_a_part_of_a_product_is_told(tmp_path, share):
    whole, part = tmp_path / "whole.h5", tmp_path / "part.h5"
    write_product(groups(), whole)
    content = whole.read_bytes()
    part.write_bytes(content[: int(share * len(content))])
    with pytest.raises(DataError, match=rf"^{part}: damaged HDF5 file \(.*\); make or copy it again$"):
        open_group(part)
