"""Products on disk: written whole or not at all, with where they came from."""

import glob
import hashlib
import json
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from erm.common.errors import DataError
from erm.common.netcdf import write_group
from erm.common.version import __version__

if TYPE_CHECKING:
    import xarray as xr

SOFTWARE = f"sounder-to-map {__version__}"
CONVENTIONS = "CF-1.11"


@contextmanager
def atomic_path(target: Path | str) -> Iterator[Path]:
    """Yield a temporary path beside ``target`` that takes its place when the block ends well.

    The file is flushed to disk before the rename, so a reader sees the old file or the whole new one. When the
    block raises, Ctrl-C included, the temporary file and folders made for it are removed, and ``target`` is as it was.

    Raises
    ------
    DataError
        The folder cannot be made or written to.
    """
    target = Path(target)
    if target.parent.is_file():
        raise DataError(f"{target.parent}: is a file; choose a folder to write into")
    temporary = target.with_name(f".{target.name}.{uuid4().hex[:8]}.part{target.suffix}")
    made = [folder for folder in target.parents if not folder.exists()]
    try:
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            temporary.touch()
            temporary.unlink()  # some writers refuse to overwrite
        except OSError as error:
            raise DataError(f"{target}: cannot be written ({error.strerror}); choose a writable folder") from error
        yield temporary
        descriptor = os.open(temporary, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
        os.replace(temporary, target)
    except BaseException as error:
        with suppress(OSError):  # of a folder that cannot be made, or holds something already
            temporary.unlink(missing_ok=True)
            for folder in made:
                folder.rmdir()
        if isinstance(error, OSError):
            raise DataError(f"{target}: cannot be written ({error.strerror or error}); is the disk full?") from error
        raise


def clear_leftovers(target: Path) -> None:
    """Remove what a process that was killed while it wrote ``target`` left beside it; nobody may be writing it now."""
    for leftover in target.parent.glob(f".{glob.escape(target.name)}.*.part{target.suffix}"):
        with suppress(OSError):
            leftover.unlink()


def sha256(path: Path | str) -> str:
    """SHA-256 of a file, hexadecimal; a file of many positions is read once."""
    facts = os.stat(path)
    return _sha256(os.fspath(path), facts.st_mtime_ns, facts.st_size)


@lru_cache(maxsize=256)
def _sha256(path: str, modified: int, size: int) -> str:  # the last two tell a changed file
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def provenance(
    title: str, history: str, *, inputs: Iterable[Path | str] = (), options: Mapping[str, Any] | None = None
) -> dict[str, str]:
    """Root attributes every product carries.

    There is no time of day among them: the same inputs, options and software give the same bytes.

    Parameters
    ----------
    title : str
        What the product is, one line.
    history : str
        The step that made it, as a user would type it.
    inputs : iterable of path
        Files read; stored by name with their SHA-256.
    options : mapping
        Every processing option; stored as JSON.
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
    """Hash of each file by its name, with its folder where names alone are not different."""
    names = [path.name for path in paths]
    return {
        path.name if names.count(path.name) == 1 else f"{path.absolute().parent.name}/{path.name}": sha256(path)
        for path in paths
    }


def write_product(groups: Mapping[str, "xr.Dataset"], target: Path | str) -> None:
    """Write datasets as the groups of one netCDF4-compatible HDF5 file, whole or not at all.

    Parameters
    ----------
    groups : mapping of str to xarray.Dataset
        ``"/"`` is the root group.
    target : path
        The file.
    """
    import h5py  # imported slowly: --help must not pay for it

    with atomic_path(target) as temporary, h5py.File(temporary, "w") as file:
        for group, dataset in groups.items():
            write_group(file.require_group(group), dataset)


def require_file(path: Path) -> None:
    """Refuse what is not a file.

    Raises
    ------
    DataError
        It is a folder, is not there, is empty or not to be read.
    """
    if path.is_dir():
        raise DataError(f"{path}: is a folder; name the files in it, as in {path / '*'}")
    if not path.is_file():
        raise DataError(f"{path}: no such file")
    if not os.access(path, os.R_OK):
        raise DataError(f"{path}: may not be read; ask its owner for permission")
    if not path.stat().st_size:
        raise DataError(f"{path}: is empty; make or copy it anew")


def damaged(path: Path, error: OSError) -> DataError:
    """What the HDF5 library says of a file that it cannot read, in words where the file is cut short."""
    whole = re.search(r"stored_eof = (\d+)", str(error))
    what = f"{path.stat().st_size} of its {whole[1]} bytes" if whole else str(error)
    return DataError(f"{path}: damaged HDF5 file ({what}); make or copy it anew")


def open_group(path: Path | str, group: str = "/", expected: str = "a product of this software") -> "xr.Dataset":
    """Load one group of a product into memory and close the file; errors tell what it is ``expected`` to be.

    Raises
    ------
    DataError
        The file is missing, is not HDF5 or only a part of it, or has no such group.
    """
    import h5py  # imported slowly: --help must not pay for it
    import xarray as xr

    path = Path(path)
    require_file(path)
    if not h5py.is_hdf5(path):
        raise DataError(f"{path}: not an HDF5 file; expected {expected}")
    try:
        with h5py.File(path, "r") as file:
            held = sorted(file)
            present = group in file
        if not present:
            what = "holds raw captures" if "iq" in held else f"holds {', '.join(held[:5]) or 'nothing'}"
            then = "process them first" if "iq" in held else f"expected {expected}"
            raise DataError(f"{path}: {what} and no group {group}; {then}")
        with xr.open_dataset(path, group=group, engine="h5netcdf", phony_dims="sort") as dataset:
            return dataset.load()
    except OSError as error:
        raise damaged(path, error) from None
