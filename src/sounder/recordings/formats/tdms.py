"""TDMS of National Instruments, by npTDMS."""

from pathlib import Path
from typing import Any

import numpy as np

from erm.common.errors import DataError
from erm.common.gate.limits import EXPANSION, current, too_large
from erm.common.optional import require_library
from sounder.recordings.formats.content import Content


def is_format(path: Path) -> bool:
    """Whether the file begins with the tag of a TDMS segment."""
    with open(path, "rb") as file:
        return file.read(4) == b"TDSm"


def content(path: Path) -> Content:
    """Read all channels: datasets ``group/channel``, with the properties of the file as attributes.

    Raises
    ------
    DataError
        npTDMS is not installed, or the file is damaged or larger than the limit of memory.
    """
    library = require_library("nptdms", "tdms", f"{path}: TDMS", "export the file in another format")
    if (needed := EXPANSION * path.stat().st_size) > current().max_bytes:
        raise DataError(f"{path}: {too_large(needed)}")
    try:
        file = library.TdmsFile.read(str(path))
        channels = [(group.name, channel) for group in file.groups() for channel in group.channels()]
        arrays: dict[str, Any] = {
            f"{group}/{channel.name}": np.asarray(channel[:])
            for group, channel in channels
            if channel.data_type is not None and np.asarray(channel[:]).dtype.kind in "biufc"
        }
        attributes = {str(name): value for name, value in file.properties.items()
                      if isinstance(value, (int, float, str))}  # fmt: skip
        for group, channel in channels:
            for name, value in channel.properties.items():
                if isinstance(value, (int, float, str)):
                    attributes[f"{group}/{channel.name}/{name}"] = value
    except Exception as error:  # the parser raises errors of many types for damaged files
        reason = " ".join(str(error).split()) or type(error).__name__
        raise DataError(f"{path}: damaged TDMS file ({reason}); export it again") from None
    return Content("TDMS", arrays, attributes)
