"""Files to jobs: each position with the back-to-back it is calibrated with."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from erm.common.errors import DataError
from sounder import shipped
from sounder.instrument.description import Sounder, load_sounder
from sounder.recordings import foreign, native
from sounder.recordings.layout import load_layout
from sounder.recordings.open import open_recordings
from sounder.recordings.recording import BackToBack, Recording


@dataclass(frozen=True)
class Source:
    """Where a recording came from: enough to open it again in another process.

    Attributes
    ----------
    path : Path
        Recording file.
    position : int
        Place among the file's positions.
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
    """A recording, the back-to-back it is calibrated with, and where they came from."""

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
    """Open recordings and find the back-to-back of each.

    Parameters
    ----------
    paths : sequence of path
        Files, one or many positions each.
    calibration : path, optional
        Native back-to-back file; goes before one inside a recording file.
    layout : path, optional
        How the files are laid out, for foreign ones.
    sounder : path, optional
        Sounder description; default for foreign files is the shipped one, for native ones their own.

    Returns
    -------
    jobs : list of Job
    failures : list of str
        One line for each file or position that cannot be used.

    Raises
    ------
    DataError
        The calibration, the layout or the description cannot be used, so nothing can.
    """
    calibration, layout, sounder = (None if path is None else Path(path) for path in (calibration, layout, sounder))
    if calibration is not None and not calibration.exists():
        raise DataError(f"{calibration}: no such file; expected a back-to-back recording; {_shipped()}")
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
                raise DataError(_uncalibrated(path))
        except DataError as error:
            failures.append(str(error))
            continue
        failures += refusals(path, found)
        jobs += [
            Job(item, own, Source(path, position, calibration, layout, sounder))
            for position, item in enumerate(found)
            if not isinstance(item, DataError)
        ]
    return jobs, failures


def refusals(path: Path, found: Sequence[Recording | DataError]) -> list[str]:
    """One line for each thing that is wrong with positions of a file from :func:`open_file`."""
    return told_once([(str(item), path) for item in found if isinstance(item, DataError)], [path] * len(found))


def told_once(failures: Sequence[tuple[str, Path]], positions: Sequence[Path]) -> list[str]:
    """Say what failed alike in several positions once, with their number.

    Parameters
    ----------
    failures : sequence of (str, Path)
        What failed, and the file of the position.
    positions : sequence of Path
        The file of every position, those that did not fail included.
    """
    alike: dict[str, list[Path]] = {}
    for failure, file in failures:
        alike.setdefault(failure, []).append(file)
    lines = []
    for failure, files in alike.items():
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
        One a position; what cannot be used stands as its error.
    b2b : BackToBack or None
        Where a foreign file holds one.

    Raises
    ------
    DataError
        The file, the layout or the description cannot be used.
    """
    described = None if sounder is None else load_sounder(sounder)
    if layout is None:
        return open_recordings(path, described), None
    plan = load_layout(layout)
    base = described or _unnamed(layout)
    return foreign.recordings(path, plan, base), foreign.back_to_back(path, plan, base)


def _unnamed(layout: Path) -> Sounder:
    """The shipped description as what a layout overrides; the instrument is another, so its name is not kept."""
    return load_sounder(shipped.calibration("sounder-132ghz.toml")).model_copy(
        update={"name": f"sounder of {layout.name}"}
    )


def reopen(source: Source) -> Job:
    """Open a position again, where its job cannot be passed on.

    Raises
    ------
    DataError
        The files are no longer what they were.
    """
    found, inside = _opened(source.path, source.layout, source.sounder)
    b2b = inside if source.calibration is None else _calibration(source.calibration)
    recording = found[source.position]
    if isinstance(recording, DataError):
        raise recording
    if b2b is None:
        raise DataError(_uncalibrated(source.path))
    return Job(recording, b2b, source)


def _uncalibrated(path: Path) -> str:
    return f"{path}: no back-to-back capture; pass one with --calibration; {_shipped()}"


def _shipped() -> str:
    return f"the synthetic one that ships is {shipped.calibration('back-to-back-132ghz.h5')}"


@lru_cache(maxsize=8)
def _opened(
    path: Path, layout: Path | None, sounder: Path | None
) -> tuple[Sequence[Recording | DataError], BackToBack | None]:
    return open_file(path, layout=layout, sounder=sounder)


@lru_cache(maxsize=8)
def _calibration(path: Path) -> BackToBack:
    return native.back_to_back(path)
