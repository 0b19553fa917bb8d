"""From files to jobs: each position with the back-to-back that calibrates it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

from erm.common.errors import DataError
from erm.common.gate.files import require_file
from sounder import shipped
from sounder.instrument.description import Scan, Sounder, load_sounder
from sounder.recordings import foreign, native
from sounder.recordings.layout import Layout, load_layout
from sounder.recordings.open import open_recordings
from sounder.recordings.recording import BackToBack, PositionError, Recording
from sounder.toml import file_inside


@dataclass(frozen=True)
class Explained:
    """Files that explain recordings, as passed to :func:`gather`."""

    calibration: Path | None = None
    layout: Path | None = None
    sounder: Path | None = None
    positions: Path | None = None

    @property
    def files(self) -> set[Path]:
        """Those that there are."""
        return {path for path in vars(self).values() if path is not None}


@dataclass(frozen=True)
class Source:
    """Where a recording came from; enough to open it again in another process.

    Attributes
    ----------
    path : Path
        Recording file.
    position : int
        Index of the position in the file.
    explained : Explained
        What explains the file.
    """

    path: Path
    position: int
    explained: "Explained"


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
    positions: Path | str | None = None,
    skip: Sequence[str] = (),
) -> tuple[list[Job], list[str]]:
    """Open recordings and find the back-to-back that calibrates each.

    Parameters
    ----------
    paths : sequence of path
        Recordings, with one or many positions each.
    calibration : path, optional
        Native back-to-back recording, or a foreign one that the layout describes. It replaces one that a recording
        file holds.
    layout : path, optional
        Layout of the files, if they are foreign.
    sounder : path, optional
        Sounder description. Default: for native files their own, for foreign files the shipped one.
    positions : path, optional
        Text table that the layout describes under ``positions.table``.
    skip : sequence of str
        Names of positions that are left out.

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
    explained = Explained(*(None if path is None else Path(path) for path in (calibration, layout, sounder, positions)))
    _calibration.cache_clear()  # files may have changed
    _require(explained)
    jobs: list[Job] = []
    left_out = set()
    failures: list[str] = []
    for path in map(Path, paths):
        try:
            found, b2b = open_file(path, explained)
            if b2b is None:
                raise DataError(_no_calibration(path))
        except DataError as error:
            failures.append(str(error))
            continue
        left_out |= {item.name for item in found if item.name in skip}
        failures += failure_lines(path, [item for item in found if item.name not in skip])
        jobs += [
            Job(item, b2b, Source(path, position, explained))
            for position, item in enumerate(found)
            if isinstance(item, Recording) and item.name not in skip
        ]
    failures += [f"skip: no position is named {name}" for name in skip if name not in left_out]
    return jobs, failures


def _require(explained: Explained) -> None:
    """Refuse at the start what no recording can be opened with."""
    calibration, layout = explained.calibration, explained.layout
    if calibration is not None:
        if not calibration.exists():
            raise DataError(f"{calibration}: no such file; expected a back-to-back recording; {_shipped_calibration()}")
        if layout is None or native.is_back_to_back(calibration):
            _calibration(calibration)
    if layout is not None:
        load_layout(layout)
    if explained.sounder is not None:
        load_sounder(explained.sounder)
    if explained.positions is not None:
        require_file(explained.positions, "a table of positions")


def failure_lines(path: Path, found: Sequence[Recording | PositionError]) -> list[str]:
    """One line for each error of positions of a file, from :func:`open_file`."""
    return merge_failures([(str(item), path) for item in found if isinstance(item, PositionError)], [path] * len(found))


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


def open_file(path: Path, explained: Explained) -> tuple[Sequence[Recording | PositionError], BackToBack | None]:
    """Open a recording file, native or foreign.

    Returns
    -------
    recordings : sequence of Recording or PositionError
        One for each position; the error in place of a position that cannot be used.
    b2b : BackToBack or None
        That of ``explained``, or the one that a foreign file holds.

    Raises
    ------
    DataError
        The file, the layout or the description cannot be used.
    """
    given = None if explained.sounder is None else load_sounder(explained.sounder)
    calibration, layout = explained.calibration, explained.layout
    if layout is None:
        return open_recordings(path, given), None if calibration is None else _calibration(calibration)
    where = load_layout(layout)
    base = given or _default_description(layout)
    found = foreign.recordings(path, where, base, positions=explained.positions or _table(layout, where))
    if given is None and "scan" not in where.sounder:
        found = [item if isinstance(item, PositionError) else _scanned_as_recorded(item) for item in found]
    if calibration is not None and native.is_back_to_back(calibration):
        return found, _calibration(calibration)
    return found, foreign.back_to_back(path, where, base, calibration=calibration)


def _table(layout: Path, where: Layout) -> Path | None:
    """Table of positions that a layout names. It may come from others, so it names no files elsewhere."""
    table = where.positions.table
    return None if table is None or table.file is None else file_inside(layout, table.file, "positions.table")


def _scanned_as_recorded(recording: Recording) -> Recording:
    """Recording of a scan that nobody described: that of its own directions."""
    scan = Scan(azimuth=tuple(recording.azimuth.tolist()), elevation=tuple(recording.elevation.tolist()))
    return replace(recording, sounder=recording.sounder.model_copy(update={"scan": scan}))


def _default_description(layout: Path) -> Sounder:
    """Shipped description, for a layout to override.

    It describes another instrument, so neither its name nor its levels nor its errors are kept.
    """
    shipped_one = load_sounder(shipped.calibration("sounder-132ghz.toml"))
    required = {name for name, field in Sounder.model_fields.items() if field.is_required()}
    return Sounder(**{**{name: getattr(shipped_one, name) for name in required}, "name": f"sounder of {layout.name}"})


def reopen_job(source: Source) -> Job:
    """Open a position again, in a process to which its job cannot be sent.

    Raises
    ------
    DataError
        The files changed since the job was made, and cannot be used.
    """
    found, b2b = _open_file(source.path, source.explained)
    recording = found[source.position]
    if isinstance(recording, PositionError):
        raise recording
    if b2b is None:
        raise DataError(_no_calibration(source.path))
    return Job(recording, b2b, source)


def _no_calibration(path: Path) -> str:
    return f"{path}: no back-to-back capture; pass one with --calibration; {_shipped_calibration()}"


def _shipped_calibration() -> str:
    return f"the shipped synthetic one is {shipped.calibration('back-to-back-132ghz.h5')}"


@lru_cache(maxsize=8)
def _open_file(path: Path, explained: Explained) -> tuple[Sequence[Recording | PositionError], BackToBack | None]:
    return open_file(path, explained)


@lru_cache(maxsize=8)
def _calibration(path: Path) -> BackToBack:
    return native.back_to_back(path)
