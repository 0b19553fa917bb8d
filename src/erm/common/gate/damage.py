"""One line for whatever HDF5 makes of a file that it cannot read."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from erm.common.errors import DataError
from erm.common.interrupts import raise_lost_interrupt


@contextmanager
def refused(path: Path, what: str = "") -> Iterator[None]:
    """Turn whatever HDF5 makes of a damaged or hostile file into a DataError of one line."""
    try:
        yield
    except DataError:
        raise
    except MemoryError:
        raise DataError(f"{path}: {what}does not fit into memory") from None
    except Exception as error:  # h5py raises errors of many types for damaged files
        raise_lost_interrupt()
        raise damaged(path, error, what) from None
    raise_lost_interrupt()  # HDF5 may have ended a list of members early


def damaged(path: Path, error: Exception, what: str = "") -> DataError:
    """Error for an HDF5 file that cannot be read: it vanished, is locked, is cut short, or is damaged."""
    if not path.is_file():
        return DataError(f"{path}: is gone; it was there when reading began")
    text = " ".join(str(error).split())
    if "unable to lock file" in text:
        return DataError(f"{path}: is locked: another program has it open for writing; close it there, or wait")
    if "filter returned failure" in text or "Fletcher32" in text:  # the second is what older HDF5 says
        text = "its checksum does not hold, or it cannot be unpacked"
    whole = re.search(r"stored_eof = (\d+)", text)
    reason = f"{path.stat().st_size} of its {whole[1]} bytes" if whole else text or type(error).__name__
    return DataError(f"{path}: damaged HDF5 file ({what}{reason}); make or copy it again")
