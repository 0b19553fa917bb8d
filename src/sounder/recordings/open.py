"""Opening a recording in any known format.

A reader is a module with ``is_format(path) -> bool`` and ``recordings(path, sounder=None) -> list[Recording]``, or for
formats of plain samples ``content(path) -> Content``, which a layout refers to. Readers are found through the entry
point group ``sounder.readers``; those in `sounder.recordings.formats` and the native one are always there. Files in no
known format are read with a layout: :mod:`sounder.recordings.foreign`.
"""

from pathlib import Path

from erm.common.errors import DataError
from erm.common.gate.files import require_file
from erm.common.gate.hdf5 import is_hdf5
from sounder.instrument.description import Sounder
from sounder.recordings import native
from sounder.recordings.formats.find import readers
from sounder.recordings.recording import Recording


def open_recordings(path: Path | str, sounder: Sounder | None = None) -> list[Recording]:
    """Open a recording in any format that a reader knows. No sample is read.

    Parameters
    ----------
    path : path
        The file.
    sounder : Sounder, optional
        Replaces the description that the file holds.

    Returns
    -------
    list of Recording
        One for each position.

    Raises
    ------
    DataError
        There is no such file, or no reader knows its format.

    Examples
    --------
    >>> import sounder
    >>> from sounder import shipped
    >>> [recording] = sounder.open_recordings(shipped.calibration("recording-132ghz.h5"))
    >>> recording.tx_position.tolist(), recording.rx_position.tolist()
    ([30.0, 5.0, 3.0], [0.0, 0.0, 1.5])
    """
    path = Path(path)
    require_file(path)
    for reader in (native, *readers()):
        if not reader.is_format(path):
            continue
        if not hasattr(reader, "recordings"):
            kind = reader.content(path).kind
            raise DataError(
                f"{path}: {kind}, which holds no directions and positions; describe them with --layout FILE"
            )
        found: list[Recording] = reader.recordings(path, sounder)
        return found
    if (what := native.other_kind(path)) is not None:
        raise DataError(f"{path}: holds a {what}, not a recording")
    if path.suffix.lower() != ".mat" and not is_hdf5(path):
        raise DataError(
            f"{path}: not an HDF5 file; expected a recording in HDF5, or a MATLAB file (.mat) with --layout FILE"
        )
    raise DataError(f"{path}: not a recording of a known format; describe its layout with --layout FILE")
