"""Recordings in any readable format to native ones."""

from pathlib import Path

from erm.common.errors import DataError
from sounder.processing.jobs import open_file, refusals
from sounder.processing.pipeline import Targets
from sounder.processing.position import Outcome
from sounder.recordings.writer import write_back_to_back, write_recording


def convert_file(path: Path, out: Path, *, layout: Path | None = None, sounder: Path | None = None) -> Outcome:
    """Write the positions of a file as native recordings, and the back-to-back it holds as a native one.

    Parameters
    ----------
    path : Path
        File in any readable format.
    out : Path
        A ``.h5`` file for one position and nothing else; otherwise a folder.
    layout, sounder : Path, optional
        As for :func:`sounder.processing.jobs.gather`.

    Returns
    -------
    Outcome

    Raises
    ------
    DataError
        The file cannot be read, or holds more than one file can take.
    """
    found, b2b = open_file(path, layout=layout, sounder=sounder)
    outcome = Outcome(failures=refusals(path, found))
    recordings = [item for item in found if not isinstance(item, DataError)]
    single = out.suffix == ".h5"
    if single and (len(recordings) > 1 or b2b is not None):
        raise DataError(f"{path}: holds {len(recordings)} positions and more; pass a folder as --out, not {out}")
    targets = Targets(out.parent if single else out, [path])
    for recording in recordings:
        try:
            target = targets.claim(recording, name=out.stem if single else None)
        except DataError as error:
            outcome.failures.append(str(error))
            continue
        try:
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
