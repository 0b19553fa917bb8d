"""Datasets as groups of a netCDF4-compatible HDF5 file. The same dataset always gives the same bytes.

xarray's writers first make an empty scale for each dimension, and replace it by the coordinate later. HDF5 reuses the
space of the empty scale only if Python has released it. A profiler that samples frames, as that of dask's workers, can
keep it alive; then the same content stands at other places in the file. This writer replaces nothing.

References
----------
The NetCDF-4 file format, Unidata, appendix "NetCDF-4 File Format Specification"; HDF5 Dimension Scale Specification.
"""

from typing import TYPE_CHECKING

from erm.common.integrity import checksummed

if TYPE_CHECKING:
    import h5py
    import xarray as xr

NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable.%10d"


def write_group(group: "h5py.Group", dataset: "xr.Dataset") -> None:
    """Write a dataset into an empty group.

    Parameters
    ----------
    group : h5py.Group
        Group of a file that is open for writing.
    dataset : xarray.Dataset
        Complex numbers are written as h5py writes them; netCDF has no type for them.
    """
    import xarray as xr

    variables, attributes = xr.conventions.encode_dataset_coordinates(dataset)
    encoded = {
        str(name): xr.conventions.encode_cf_variable(variable, name=name) for name, variable in variables.items()
    }
    group.attrs.update(attributes)
    for dimension, size in dataset.sizes.items():
        name = str(dimension)
        if name in encoded:
            _create(group, name, encoded[name]).make_scale(name)
        else:
            group.create_dataset(name, (size,), ">f4").make_scale(NO_VARIABLE % size)
    for name, variable in encoded.items():
        if name not in dataset.dims:
            made = _create(group, name, variable)
            for axis, dimension in enumerate(variable.dims):
                made.dims[axis].attach_scale(group[str(dimension)])


def _create(group: "h5py.Group", name: str, variable: "xr.Variable") -> "h5py.Dataset":
    import h5py
    import numpy as np

    attributes = dict(variable.attrs)
    values = np.asarray(variable.values)
    if values.dtype.kind in "UO":
        dataset = group.create_dataset(name, data=values.astype(object), dtype=h5py.string_dtype())
    else:
        options = checksummed(values.shape, values.itemsize)
        dataset = group.create_dataset(name, data=values, fillvalue=attributes.get("_FillValue"), **options)
        if "_FillValue" in attributes:  # netCDF stores an attribute of one value as an array
            attributes["_FillValue"] = np.array([attributes["_FillValue"]], values.dtype)
    dataset.flush()  # chunks get their place now, not when Python releases the dataset
    dataset.attrs.update(attributes)
    return dataset
