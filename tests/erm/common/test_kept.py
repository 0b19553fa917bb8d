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
    with keeping():
        first, _ = storage.open_groups(path, "/", "/g")
        first.attrs["mine"] = True
        second = storage.open_group(path)
        assert opened == [path]
        assert "mine" not in second.attrs
        with pytest.raises(ValueError, match="read-only"):
            second["a"].values[:] = 0.0  # is shared
        storage.write_product({"/": xr.Dataset({"a": ("x", np.arange(4.0))})}, path)
        assert storage.open_group(path).sizes["x"] == 4
        path.unlink()
        with pytest.raises(DataError, match="no such file"):
            storage.open_group(path)
    assert len(opened) == 3
