"""Datasets as groups of a netCDF4-compatible HDF5 file. The same dataset always gives the same bytes.

xarray's writers first make an empty scale for each dimension, and replace it by the coordinate later. HDF5 reuses the
space of the empty scale only if Python has released it. A profiler that samples frames, as that of dask's workers, can
keep it alive; then the same content stands at other places in the file. This writer replaces nothing.

The reader asks HDF5 once for each member. h5netcdf looks up each dimension of each variable many times, which takes
several times as long for products: their groups have many small variables.

References
----------
The NetCDF-4 file format, Unidata, appendix "NetCDF-4 File Format Specification"; HDF5 Dimension Scale Specification.
"""

from collections.abc import Mapping
from numbers import Real
from typing import TYPE_CHECKING, Any

from erm.common.errors import DataError
from erm.common.gate.hdf5 import Dataset, Group
from erm.common.integrity import checksummed
from erm.common.usage import shortened

if TYPE_CHECKING:
    import h5py
    import numpy as np
    import xarray as xr

NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable.%10d"
NUMBERS = "biufc"
TEXTS = "UO"
"""Kinds of numbers and of texts, as numpy names them."""
STRUCTURE = {
    "CLASS",
    "NAME",
    "REFERENCE_LIST",
    "DIMENSION_LIST",
    "_Netcdf4Dimid",
    "_Netcdf4Coordinates",
    "_NCProperties",
}
"""Attributes of HDF5 and netCDF for themselves, most of which tie variables to dimensions."""
CODES = {"_FillValue", "missing_value", "scale_factor", "add_offset"}
"""Attributes of CF that tell what stored values stand for."""


def write_group(group: "h5py.Group", dataset: "xr.Dataset") -> None:
    """Write a dataset into an empty group.

    Parameters
    ----------
    group : h5py.Group
        Group of a file that is open for writing.
    dataset : xarray.Dataset
        Complex numbers are written as h5py writes them; netCDF has no type for them.
    """
    encoded, attributes = _encoded(dataset)
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


def _encoded(dataset: "xr.Dataset") -> "tuple[dict[str, xr.Variable], dict[Any, Any]]":
    """Variables and attributes of a group, as they are stored."""
    import xarray as xr

    variables, attributes = xr.conventions.encode_dataset_coordinates(dataset)
    stored = {str(name): xr.conventions.encode_cf_variable(variable, name=name) for name, variable in variables.items()}
    return stored, attributes


def as_read(dataset: "xr.Dataset") -> "xr.Dataset":
    """What `read_group` makes of a group that `write_group` made of a dataset; it shares no arrays with it."""
    import numpy as np
    import xarray as xr

    encoded, attributes = _encoded(dataset)
    ordered = sorted(sorted(encoded), key=dataset.dims.__contains__)
    variables = {}
    for name in ordered:
        values = np.array(encoded[name].values)
        texts = values.dtype.kind in TEXTS
        variables[name] = xr.Variable(encoded[name].dims, values.astype(str) if texts else values)
        variables[name].attrs = _stored(encoded[name].attrs)
    return _decoded(variables, _stored(attributes))


def _stored(attributes: Mapping[Any, Any]) -> dict[Any, Any]:
    """Attributes as HDF5 gives them back."""
    import numpy as np

    return {
        name: value if isinstance(value, str) else _single(np.asarray(value)[()]) for name, value in attributes.items()
    }


def _decoded(variables: "Mapping[str, xr.Variable]", attributes: Mapping[str, Any]) -> "xr.Dataset":
    import numpy as np
    import xarray as xr

    with np.errstate(over="ignore", invalid="ignore"):  # what comes out is checked where it is used
        return xr.decode_cf(xr.Dataset(variables, attrs=attributes)).load().drop_encoding()


def read_group(group: Group) -> "xr.Dataset":
    """Read the variables of a group into memory, decoded by the conventions of CF.

    Parameters
    ----------
    group : Group
        Group of any netCDF4 or HDF5 file. Axes without a dimension are called after their length: ``axis_3``; a second
        one of this length in a variable is ``axis_3_1``.

    Raises
    ------
    DataError
        A member holds neither numbers nor texts, or its values cannot be decoded.
    """
    members = {name: member for name, member in group.items() if isinstance(member, Dataset) and not member.empty}
    dimensions = _dimensions(members)
    ordered = sorted(members, key=lambda name: members[name].is_scale)  # coordinates last, as netCDF lists them
    variables = {
        name: _read(members[name], dimensions[name]) for name in ordered if not _is_bare_dimension(members[name])
    }
    attributes = {name: _single(value) for name, value in group.attrs.items() if name not in STRUCTURE}
    return _decoded(variables, attributes)


def _is_bare_dimension(member: Dataset) -> bool:
    """Whether a scale has a length and no values."""
    name = member.attrs.get("NAME") if member.is_scale else None
    return isinstance(name, str) and name.startswith(NO_VARIABLE.partition("%")[0])


def _read(member: Dataset, dimensions: list[str]) -> "xr.Variable":
    import h5py
    import numpy as np
    import xarray as xr

    name = member.name.rpartition("/")[2]
    attributes = {key: _single(member.attrs[key]) for key in member.attrs if key not in STRUCTURE}
    text = h5py.check_string_dtype(member.dtype) is not None
    if not text and member.dtype.kind not in NUMBERS:
        raise DataError(f"{member.path}: {name} is {member.dtype}; expected numbers or texts")
    values = member[()]
    if text and member.dtype.kind == "O":
        values = np.asarray(member.node.asstr()[()], str)
    for key in CODES & attributes.keys():
        if not isinstance(attributes[key], str if text else Real):
            raise DataError(
                f"{member.path}: attribute {key} of {name} is {shortened(attributes[key])}; expected one "
                f"{'text' if text else 'number'}"
            )
    if values.dtype.kind in "iu":
        for key in {"_FillValue", "missing_value"} & attributes.keys():
            if not float(attributes[key]).is_integer():  # NaN, as of real numbers
                raise DataError(
                    f"{member.path}: attribute {key} of {name} is {attributes[key]}; expected a whole number"
                )
    return xr.Variable(dimensions, values, attributes)


def _dimensions(members: Mapping[str, Dataset]) -> dict[str, list[str]]:
    """Names of the axes of variables.

    Each scale lists the variables that it belongs to. The variables list their scales too, but in lists of any length,
    which HDF5 reads for seconds where a length is damaged.
    """
    import h5py

    places = {h5py.h5o.get_info(member.node.id).addr: name for name, member in members.items()}
    attached = {
        (places.get(place), axis): name
        for name, member in members.items()
        if member.is_scale
        for place, axis in _attached(member).tolist()
    }
    named: dict[str, list[str]] = {}
    for name, member in members.items():
        if member.is_scale and member.ndim == 1:
            named[name] = [name]
            continue
        called = [attached.get((name, axis), f"axis_{length}") for axis, length in enumerate(member.shape)]
        again = [called[:axis].count(one) for axis, one in enumerate(called)]
        named[name] = [f"{one}_{count}" if count else one for one, count in zip(called, again, strict=True)]
    return named


def _attached(scale: Dataset) -> "np.ndarray":
    """Place in the file of each variable that a scale belongs to, and its axis.

    HDF5 would look for the name of a reference in all groups, and crash where they are nested too deeply.
    """
    import h5py
    import numpy as np

    if "REFERENCE_LIST" not in scale.attrs:
        return np.zeros(0, "<u8,<u4")
    listed = scale.attrs.sized("REFERENCE_LIST")
    kind = listed.get_type()
    if kind.get_class() != h5py.h5t.COMPOUND or kind.get_member_type(0) != h5py.h5t.STD_REF_OBJ:
        raise DataError(f"{scale.path}: {scale.name} is an axis of {kind.dtype}; expected references to variables")
    raw = np.empty(listed.shape, f"V{kind.get_size()}")
    listed.read(raw, kind)
    names = [kind.get_member_name(number).decode() for number in (0, 1)]
    places = [kind.get_member_offset(number) for number in (0, 1)]
    layout = np.dtype({"names": names, "formats": ["<u8", "<u4"], "offsets": places, "itemsize": kind.get_size()})
    return np.ravel(raw.view(layout))


def _single(value: Any) -> Any:
    """The only element of an attribute in place of an array, as netCDF has it."""
    import numpy as np

    return value.reshape(-1)[0] if isinstance(value, np.ndarray) and value.size == 1 else value


def _create(group: "h5py.Group", name: str, variable: "xr.Variable") -> "h5py.Dataset":
    import h5py
    import numpy as np

    attributes = dict(variable.attrs)
    values = np.asarray(variable.values)
    if values.dtype.kind in TEXTS:
        dataset = group.create_dataset(name, data=values.astype(object), dtype=h5py.string_dtype())
    else:
        options = checksummed(values.shape, values.itemsize)
        dataset = group.create_dataset(name, data=values, fillvalue=attributes.get("_FillValue"), **options)
        if "_FillValue" in attributes:  # netCDF stores an attribute of one value as an array
            attributes["_FillValue"] = np.array([attributes["_FillValue"]], values.dtype)
    dataset.flush()  # chunks get their place now, not when Python releases the dataset
    dataset.attrs.update(attributes)
    return dataset
