"""Files of products, with their provenance."""

import hashlib
import json
import math
import os
import stat
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any

from erm.common.atomic import atomic_path
from erm.common.errors import DataError
from erm.common.gate.damage import refused
from erm.common.gate.hdf5 import Group, open_hdf5
from erm.common.gate.limits import current, too_large
from erm.common.hdf5_output import new_hdf5
from erm.common.integrity import MEMBERS, list_members, require_members
from erm.common.kept import kept
from erm.common.netcdf import NUMBERS, as_read, read_group, write_group
from erm.common.usage import shortened
from erm.common.version import __version__

if TYPE_CHECKING:
    import xarray as xr

SOFTWARE = f"sounder-to-map {__version__}"
CONVENTIONS = "CF-1.11"
FIGURES = {
    *("frequency", "los", "recorded_directions", "missing_directions", "problem_directions"),
    *("samples", "independent_samples", "period", "pulse_energy", "rx_antenna_gain"),
}
"""Attributes of products that are one finite number each."""


def sha256(path: Path | str) -> str:
    """SHA-256 of a file, hexadecimal; of a folder, that of the names and hashes of its files.

    Unchanged files are read once.
    """
    try:
        facts = os.stat(path)
        if stat.S_ISDIR(facts.st_mode):
            files = sorted(file for file in Path(path).iterdir() if file.is_file())
            return hashlib.sha256("".join(f"{file.name} {sha256(file)}\n" for file in files).encode()).hexdigest()
        return _sha256(os.fspath(path), facts.st_mtime_ns, facts.st_size)
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror}); it was there when the work began") from None


@lru_cache(maxsize=256)
def _sha256(path: str, modified: int, size: int) -> str:  # time and size are part of the key of the cache
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def provenance(
    title: str, history: str, *, inputs: Iterable[Path | str] = (), options: Mapping[str, Any] | None = None
) -> dict[str, str]:
    """Root attributes of every product.

    No time of day is stored: the same inputs, options and software give the same bytes.

    Parameters
    ----------
    title : str
        What the product is, in one line.
    history : str
        The command or function that made it.
    inputs : iterable of path
        Files that were read. They are stored by name with their SHA-256.
    options : mapping
        All processing options. They are stored as JSON.
    """
    return {
        "Conventions": CONVENTIONS,
        "title": title,
        "source": SOFTWARE,
        "history": history,
        "software_version": __version__,
        "input_sha256": json.dumps(_hashes([Path(path) for path in inputs]), sort_keys=True),
        "processing_options": json.dumps(dict(options or {}), sort_keys=True, default=str),
    }


def _hashes(paths: list[Path]) -> dict[str, str]:
    """SHA-256 of each file by its name; with its folder where several files have one name."""
    names = [path.name for path in paths]
    return {
        path.name if names.count(path.name) == 1 else f"{path.absolute().parent.name}/{path.name}": sha256(path)
        for path in paths
    }


def write_product(groups: Mapping[str, "xr.Dataset"], target: Path | str) -> None:
    """Write datasets as the groups of one netCDF4-compatible HDF5 file, completely or not at all.

    Within `erm.common.kept.keeping`, they are not read again.

    Parameters
    ----------
    groups : mapping of str to xarray.Dataset
        ``"/"`` is the root group.
    target : path
        The file.
    """
    with atomic_path(target) as temporary, new_hdf5(temporary) as file:
        for group, dataset in groups.items():
            write_group(file.require_group(group), dataset)
        list_members(file)
    if (held := kept()) is not None:
        for group, dataset in groups.items():
            held.add(Path(target), group, as_read(dataset))


def open_group(path: Path | str, group: str = "/", expected: str = "a product of this software") -> "xr.Dataset":
    """Load one group of a product into memory, and close the file.

    Parameters
    ----------
    path : path
        The file.
    group : str
        Name of the group.
    expected : str
        What the file should be, for errors.

    Raises
    ------
    DataError
        The file is missing, is not HDF5, is damaged, or has no such group.
    """
    return open_groups(path, group, expected=expected)[0]


def open_groups(path: Path | str, *groups: str, expected: str = "a product of this software") -> "list[xr.Dataset]":
    """Load groups of a product into memory, as :func:`open_group` does; the file is opened once.

    Within `erm.common.kept.keeping`, groups that were loaded before are not read again.
    """
    path = Path(path)
    held = kept()
    if held is None or not path.is_file():
        return _load_groups(path, groups, expected)
    found = {group: held.get(path, group) for group in groups}
    missing = [group for group in groups if found[group] is None]
    for group, dataset in zip(missing, _load_groups(path, missing, expected) if missing else (), strict=True):
        held.add(path, group, dataset)
        found[group] = dataset
    return [dataset for dataset in found.values() if dataset is not None]


def _load_groups(path: Path, groups: Sequence[str], expected: str) -> "list[xr.Dataset]":
    with open_hdf5(path, expected) as file, refused(path):
        return [_load_group(file, group, expected) for group in groups]


def _load_group(file: Group, name: str, expected: str) -> "xr.Dataset":
    found = _require_group(file, name, expected)
    require_members(file, name)
    dataset = read_group(found)
    dataset.attrs.pop(MEMBERS, None)  # of this file, not of what is made from it
    for figure in FIGURES & dataset.attrs.keys():
        value = dataset.attrs[figure]
        if not isinstance(value, Real) or not math.isfinite(value):
            raise DataError(f"{file.path}: attribute {figure} is {shortened(value)}; expected a finite number")
    return dataset


def require_axes(dataset: "xr.Dataset", path: Path | str, axes: Mapping[str, tuple[str, ...]]) -> None:
    """Refuse a dataset that lacks a variable, or in which one does not hold numbers along its axes.

    Parameters
    ----------
    dataset : xarray.Dataset
        Group of a product.
    path : path
        Its file, for errors.
    axes : mapping of str to tuple of str
        Variables with the names of their axes.
    """
    for name, wanted in axes.items():
        if name not in dataset.variables:
            raise DataError(f"{path}: has no {name}; expected a product of this software")
        held = dataset[name]
        if held.dims != wanted or held.dtype.kind not in NUMBERS:
            raise DataError(
                f"{path}: {name} is {held.dtype} along ({', '.join(map(str, held.dims))}); "
                f"expected numbers along ({', '.join(wanted)})"
            )


def _require_group(file: Group, name: str, expected: str) -> Group:
    """Refuse a file that has no such group, or in which the group or one above it has what the gate refuses."""
    node: Any = file
    total = 0
    for part in (None, *filter(None, name.split("/"))):
        node = node if part is None else node.get(part)
        if not isinstance(node, Group):
            kind = file.attrs.get("kind")
            what = f"is a {kind}" if isinstance(kind, str) else f"holds {', '.join(list(file)[:5]) or 'nothing'}"
            raise DataError(f"{file.path}: {what} and has no group {name}; expected {expected}")
        for member in node.values():
            total += 0 if isinstance(member, Group) else member.item * member.size
    if total > current().max_bytes:
        raise DataError(f"{file.path}: {name} {too_large(total)}")
    return node
