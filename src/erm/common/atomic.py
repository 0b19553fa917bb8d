"""Files that are written completely or not at all; what killed processes left of them is removed."""

import glob
import os
import shutil
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from uuid import uuid4

from erm.common.errors import DataError
from erm.common.locks import lock_of


@contextmanager
def atomic_path(target: Path | str) -> Iterator[Path]:
    """Yield a path in a hidden folder beside ``target``; the file becomes ``target`` when the block ends without error.

    The file is flushed to disk before it is renamed, so a reader sees the old file or the complete new one. When the
    block raises (Ctrl-C too), the hidden folder and new folders are removed, and ``target`` is unchanged. What killed
    processes left of ``target`` is removed first.

    Raises
    ------
    DataError
        The folder cannot be made, or is not writable.
    """
    target = Path(target)
    if target.parent.is_file():
        raise DataError(f"{target.parent}: is a file; choose a folder to write into")
    made = [folder for folder in target.parents if not folder.exists()]
    try:
        with ExitStack() as stack:
            try:
                target.parent.mkdir(parents=True, exist_ok=True)
                clear_leftovers(target)
                temporary = _hidden_folder(target, stack) / target.name
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
        with suppress(OSError):  # the folder could not be made, or is not empty
            for folder in made:
                folder.rmdir()
        if isinstance(error, OSError):
            raise DataError(f"{target}: cannot be written ({error.strerror or error}); is the disk full?") from error
        raise


def clear_leftovers(target: Path) -> None:
    """Remove what killed processes left of ``target``; what a process is writing is locked, and stays."""
    for leftover in target.parent.glob(f".{glob.escape(target.name)}.*.part"):
        with suppress(OSError), lock_of(leftover) as held:
            if held:
                shutil.rmtree(leftover)


def _hidden_folder(target: Path, stack: ExitStack) -> Path:
    """Make a folder for a new ``target``, which is locked and then removed when the stack is unwound."""
    while True:
        folder = target.with_name(f".{target.name}.{uuid4().hex[:8]}.part")
        folder.mkdir()
        stack.callback(shutil.rmtree, folder, ignore_errors=True)
        with suppress(FileNotFoundError):
            if stack.enter_context(lock_of(folder)) is not False and folder.exists():
                return folder
        # another process took it for a leftover before it was locked
