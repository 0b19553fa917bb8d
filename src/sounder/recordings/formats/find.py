"""Which format of samples a file has."""

from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from erm.common.gate.files import require_file
from sounder.recordings.formats import iq_tar, raw, sigmf_recording, tdms
from sounder.recordings.formats.content import Content

OWN = (sigmf_recording, iq_tar, tdms, raw)


@cache
def readers() -> list[Any]:
    """Modules that read files without a layout (``recordings``) or with one (``content``): own ones, then others'.

    To look for others' goes through all packages that are installed, which takes as long as to open a recording.
    """
    return [*OWN, *(entry.load() for entry in entry_points(group="sounder.readers"))]


def content_of(path: Path) -> Content | None:
    """What a file of samples holds; None if no reader knows its format."""
    require_file(path)
    for reader in readers():
        if hasattr(reader, "content") and reader.is_format(path):
            found: Content = reader.content(path)
            return found
    return None
