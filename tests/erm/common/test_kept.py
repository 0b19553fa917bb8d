"""Groups that stay in memory while many stages read the same files."""

import numpy as np
import pytest
import xarray as xr

from erm.common import storage
from erm.common.errors import DataError
from erm.common.kept import keeping


def test_a_group_is_read_once_and_a_file_written_anew_is_read_again(tmp_path, monkeypatch):
    path, opened = tmp_path / "one.h5", []
    read = storage.open_hdf5
    monkeypatch.setattr(storage, "open_hdf5", lambda *given: opened.append(given[0]) or read(*given))
    storage.write_product({"/": xr.Dataset({"a": ("x", np.arange(3.0))}), "/g": xr.Dataset(attrs={"b": 1})}, path)
    storage.write_product({"/": xr.Dataset({"a": ("x", np.arange(4.0))})}, tmp_path / "another.h5")
    with keeping():
        first, _ = storage.open_groups(path, "/", "/g")
        first.attrs["mine"] = True
        second = storage.open_group(path)
        assert opened == [path]
        assert "mine" not in second.attrs
        with pytest.raises(ValueError, match="read-only"):
            second["a"].values[:] = 0.0  # is shared
        (tmp_path / "another.h5").replace(path)
        assert storage.open_group(path).sizes["x"] == 4
        path.unlink()
        with pytest.raises(DataError, match="no such file"):
            storage.open_group(path)
    assert len(opened) == 3


def same(one, other):
    """Whether attributes have one type and value."""
    if isinstance(one, str):
        return isinstance(other, str) and one == other
    kinds = [np.asarray(value).dtype for value in (one, other)]
    return type(one) is type(other) and kinds[0] == kinds[1] and np.array_equal(one, other)


def test_what_is_written_is_kept_as_it_would_be_read(tmp_path):
    """Numbers, texts and lists that Python has, which HDF5 gives back as its own."""
    attributes = {"one": 1, "part": 0.5, "yes": True, "list": [1.0, 2.0], "single": [3.0], "none": [], "name": "räm"}
    variables = {
        "b": (("x", "y"), np.array([[1.0, np.nan]]), attributes),
        "a": ("x", np.array([2 + 1j])),
        "told": ("y", np.array([True, False])),
        "text": ("y", np.array(["", "longer"])),
        "untold": ("z", np.array([], object)),
        "count": ("z", np.zeros(0, np.int64)),
        "alone": ((), 3),
    }
    coordinates = {"x": [7.0], "y": ["left", "right"], "aside": ("y", np.array([1, 2], np.int8), {"units": "m"})}
    made, path = xr.Dataset(variables, coordinates, attributes), tmp_path / "one.h5"
    with keeping():
        storage.write_product({"/": made, "/g": xr.Dataset(attrs=attributes)}, path)
        held = storage.open_groups(path, "/", "/g")
    for kept, read in zip(held, storage.open_groups(path, "/", "/g"), strict=True):
        xr.testing.assert_identical(kept, read)
        assert list(kept.variables) == list(read.variables)
        for one, other in ((kept, read), *((kept[name], read[name]) for name in read.variables)):
            assert all(same(one.attrs[name], value) for name, value in other.attrs.items())
        assert [kept[name].dtype for name in kept.variables] == [read[name].dtype for name in read.variables]
    made["b"].values[:] = 5.0  # what is kept is not the caller's
    assert held[0]["b"].values[0, 0] == 1.0
