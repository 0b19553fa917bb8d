"""Checks of output paths, made before a command computes anything."""

import os
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from erm.common.errors import DataError, OptionError
from erm.common.locks import lock_of

FILES = (".h5", ".hdf5", ".nc", ".csv", ".json", ".geojson", ".gpkg", ".toml", ".md", ".png", ".pdf", ".svg")
"""Suffixes that an output folder must not have."""


def require_suffix(path: Path | None, *known: str) -> None:
    """Refuse a file with an unknown suffix; None is accepted.

    Raises
    ------
    OptionError
        The suffix is none of ``known``.
    """
    if path is not None and path.suffix.lower() not in known:
        *others, last = known
        choice = f"{', '.join(others)} or {last}" if others else last
        raise OptionError(f"{path}: unknown format {path.suffix!r}; choose {choice}")


def require_folder(path: Path) -> None:
    """Refuse a path that cannot be an output folder.

    Raises
    ------
    OptionError
        It is a file, has the name of a file, or is not writable.
    """
    if path.is_file():
        raise OptionError(f"{path}: is a file; choose a folder to write into")
    if path.suffix.lower() in FILES:
        raise OptionError(f"{path}: looks like a file; choose a folder to write into")
    there = next(folder for folder in (path, *path.absolute().parents) if folder.exists())
    if not os.access(there, os.W_OK | os.X_OK):
        raise OptionError(f"{path}: cannot be written; choose a writable folder")


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep a folder for this process while a block writes into it. A folder that is made and stays empty is removed.

    The lock is that of the open folder, so it ends with the process, however it ends. File systems without such locks
    give none.

    Raises
    ------
    DataError
        Another process writes into the folder, or it cannot be made.
    """
    made = [parent for parent in (folder, *folder.parents) if not parent.exists()]
    with ExitStack() as stack:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            held = stack.enter_context(lock_of(folder))
        except OSError as error:
            raise DataError(f"{folder}: cannot be written ({error.strerror}); choose a writable folder") from None
        try:
            if held is False:
                raise DataError(
                    f"{folder}: another run is writing into this folder; wait for its end, or choose another --out"
                )
            yield
        finally:
            stack.close()
            with suppress(OSError):  # not empty
                for parent in made:
                    parent.rmdir()


def protect_inputs(outputs: Iterable[Path | None], inputs: Iterable[Path]) -> None:
    """Refuse to overwrite an input, or to write two outputs to one file.

    Raises
    ------
    OptionError
        An output is an input or another output; None is accepted.
    """
    read = {path.resolve() for path in inputs}
    written: set[Path] = set()
    for output in outputs:
        if output is None:
            continue
        if output.resolve() in read:
            raise OptionError(f"{output}: is an input, which would be replaced; choose another output")
        if output.resolve() in written:
            raise OptionError(f"{output}: is given for two outputs; choose a different file for each")
        written.add(output.resolve())
