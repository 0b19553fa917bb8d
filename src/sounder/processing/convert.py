"""Conversion of recordings in any readable format to native recordings."""

from pathlib import Path

from erm.common.console import counted
from erm.common.errors import DataError
from sounder.processing.jobs import Explained, failure_lines, open_file
from sounder.processing.pipeline import OutputPaths
from sounder.processing.position import Outcome
from sounder.recordings.formats import sigmf_recording
from sounder.recordings.writer import write_back_to_back, write_recording


def convert_file(path: Path, out: Path, *, layout: Path | None = None, sounder: Path | None = None) -> Outcome:
    """Write the positions of a file, and the back-to-back it holds, as native recordings.

    Parameters
    ----------
    path : Path
        File in any readable format.
    out : Path
        A ``.h5`` or ``.sigmf-meta`` file if ``path`` holds one position and nothing else; otherwise a folder.
    layout, sounder : Path, optional
        As for :func:`sounder.processing.jobs.gather`.

    Returns
    -------
    Outcome

    Raises
    ------
    DataError
        The file cannot be read, or holds more than fits into one file.
    """
    found, b2b = open_file(path, Explained(layout=layout, sounder=sounder))
    outcome = Outcome(failures=failure_lines(path, found))
    recordings = [item for item in found if not isinstance(item, DataError)]
    as_sigmf = sigmf_recording.is_format(out)
    single = out.suffix == ".h5" or as_sigmf
    if single and (len(recordings) > 1 or b2b is not None):
        held = counted(len(recordings), "position") + (" and a back-to-back" if b2b is not None else "")
        raise DataError(f"{path}: holds {held}; --out is the file {out}, expected a folder")
    targets = OutputPaths(out.parent if single else out, [path])
    for recording in recordings:
        try:
            target = targets.claim(recording, name=out.stem if single else None)
        except DataError as error:
            outcome.failures.append(str(error))
            continue
        try:
            if as_sigmf:
                sigmf_recording.write(recording, out, history="sounder convert")
            else:
                write_recording(recording, target, history="sounder convert")
        except DataError as error:
            outcome.failures.append(str(error))
            targets.release(target)
        else:
            outcome.products.append(target)
    if b2b is not None:
        target = targets.reserve("back-to-back", f"{path}: the back-to-back recording")
        write_back_to_back(b2b, target, history="sounder convert", inputs=[path])
    return outcome
