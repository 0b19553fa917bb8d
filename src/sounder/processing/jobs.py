"""From files to jobs: each position with the back-to-back that calibrates it."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from erm.common.errors import DataError
from sounder import shipped
from sounder.instrument.description import Sounder, load_sounder
from sounder.instrument.stated import Receiver, Transmitter
from sounder.recordings import foreign, native
from sounder.recordings.layout import load_layout
from sounder.recordings.open import open_recordings
from sounder.recordings.recording import BackToBack, Recording


@dataclass(frozen=True)
class Source:
    """Where a recording came from; enough to open it again in another process.

    Attributes
    ----------
    path : Path
        Recording file.
    position : int
        Index of the position in the file.
    calibration, layout, sounder : Path or None
        As passed to :func:`gather`.
    """

    path: Path
    position: int
    calibration: Path | None
    layout: Path | None
    sounder: Path | None


@dataclass(frozen=True)
class Job:
    """A recording, the back-to-back that calibrates it, and the files that they came from."""

    recording: Recording
    b2b: BackToBack
    source: Source


def gather(
    paths: Sequence[Path | str],
    *,
    calibration: Path | str | None = None,
    layout: Path | str | None = None,
    sounder: Path | str | None = None,
) -> tuple[list[Job], list[str]]:
    """Open recordings and find the back-to-back that calibrates each.

    Parameters
    ----------
    paths : sequence of path
        Recordings, with one or many positions each.
    calibration : path, optional
        Native back-to-back recording. It replaces one that a recording file holds.
    layout : path, optional
        Layout of the files, if they are foreign.
    sounder : path, optional
        Sounder description. Default: for native files their own, for foreign files the shipped one.

    Returns
    -------
    jobs : list of Job
    failures : list of str
        One line for each file or position that cannot be used.

    Raises
    ------
    DataError
        The calibration, the layout or the description cannot be used, so no recording can.

    Examples
    --------
    >>> import sounder
    >>> from sounder import shipped
    >>> recordings = [shipped.calibration("recording-132ghz.h5"), "absent.h5"]
    >>> jobs, failures = sounder.gather(recordings, calibration=shipped.calibration("back-to-back-132ghz.h5"))
    >>> [job.recording.name for job in jobs], failures
    (['synthetic-two-paths'], ['absent.h5: no such file'])
    """
    calibration, layout, sounder = (None if path is None else Path(path) for path in (calibration, layout, sounder))
    if calibration is not None and not calibration.exists():
        raise DataError(f"{calibration}: no such file; expected a back-to-back recording; {_shipped_calibration()}")
    b2b = None if calibration is None else native.back_to_back(calibration)
    if layout is not None:
        load_layout(layout)
    if sounder is not None:
        load_sounder(sounder)
    jobs: list[Job] = []
    failures: list[str] = []
    for path in map(Path, paths):
        try:
            found, inside = open_file(path, layout=layout, sounder=sounder)
            if (own := b2b or inside) is None:
                raise DataError(_no_calibration(path))
        except DataError as error:
            failures.append(str(error))
            continue
        failures += failure_lines(path, found)
        jobs += [
            Job(item, own, Source(path, position, calibration, layout, sounder))
            for position, item in enumerate(found)
            if not isinstance(item, DataError)
        ]
    return jobs, failures


def failure_lines(path: Path, found: Sequence[Recording | DataError]) -> list[str]:
    """One line for each error of positions of a file, from :func:`open_file`."""
    return merge_failures([(str(item), path) for item in found if isinstance(item, DataError)], [path] * len(found))


def merge_failures(failures: Sequence[tuple[str, Path]], positions: Sequence[Path]) -> list[str]:
    """Merge failures of several positions that read the same into one line with their number.

    Parameters
    ----------
    failures : sequence of (str, Path)
        Failure, and the file of its position.
    positions : sequence of Path
        File of each position, whether it failed or not.
    """
    files_of: dict[str, list[Path]] = {}
    for failure, file in failures:
        files_of.setdefault(failure, []).append(file)
    lines = []
    for failure, files in files_of.items():
        one_file = len(set(files)) == 1
        total = positions.count(files[0]) if one_file else len(positions)
        count = f"all {total}" if len(files) == total else f"{len(files)} of {total}"
        where = f" ({count} positions{f' of {files[0].name}' if one_file else ''})"
        lines.append(failure + (where if len(files) > 1 else ""))
    return lines


def open_file(
    path: Path, *, layout: Path | None = None, sounder: Path | None = None
) -> tuple[Sequence[Recording | DataError], BackToBack | None]:
    """Open a recording file, native or foreign.

    Returns
    -------
    recordings : sequence of Recording or DataError
        One for each position; the error in place of a position that cannot be used.
    b2b : BackToBack or None
        The one that a foreign file holds.

    Raises
    ------
    DataError
        The file, the layout or the description cannot be used.
    """
    described = None if sounder is None else load_sounder(sounder)
    if layout is None:
        return open_recordings(path, described), None
    where = load_layout(layout)
    base = described or _default_description(layout)
    return foreign.recordings(path, where, base), foreign.back_to_back(path, where, base)


def _default_description(layout: Path) -> Sounder:
    """Shipped description, for a layout to override.

    It describes another instrument, so neither its name nor its levels are kept.
    """
    return load_sounder(shipped.calibration("sounder-132ghz.toml")).model_copy(
        update={"name": f"sounder of {layout.name}", "transmitter": Transmitter(), "receiver": Receiver()}
    )


def reopen_job(source: Source) -> Job:
    """Open a position again, in a process to which its job cannot be sent.

    Raises
    ------
    DataError
        The files changed since the job was made, and cannot be used.
    """
    found, inside = _open_file(source.path, source.layout, source.sounder)
    b2b = inside if source.calibration is None else _calibration(source.calibration)
    recording = found[source.position]
    if isinstance(recording, DataError):
        raise recording
    if b2b is None:
        raise DataError(_no_calibration(source.path))
    return Job(recording, b2b, source)


def _no_calibration(path: Path) -> str:
    return f"{path}: no back-to-back capture; pass one with --calibration; {_shipped_calibration()}"


def _shipped_calibration() -> str:
    return f"the shipped synthetic one is {shipped.calibration('back-to-back-132ghz.h5')}"


@lru_cache(maxsize=8)
def _open_file(
    path: Path, layout: Path | None, sounder: Path | None
) -> tuple[Sequence[Recording | DataError], BackToBack | None]:
    return open_file(path, layout=layout, sounder=sounder)


@lru_cache(maxsize=8)
def _calibration(path: Path) -> BackToBack:
    return native.back_to_back(path)
