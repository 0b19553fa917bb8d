"""Recordings to products: each position on its own, what fails is named and the rest is done."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from erm.errors import DataError
from erm.storage import provenance, write_product
from sounder import layout as layouts
from sounder import shipped
from sounder.calibration import Deembedding
from sounder.config import load
from sounder.correlate import Averaging, Problem, calibrate, impulse_responses
from sounder.daps import Omnidirectional, daps
from sounder.mpc import Threshold, extract
from sounder.readers import layout as foreign
from sounder.readers import native, open_recordings
from sounder.recording import BackToBack, Recording


@dataclass(frozen=True)
class Options:
    """How recordings are processed; stored in every product."""

    averaging: Averaging = "coherent"
    threshold: Threshold = "usc"
    omnidirectional: Omnidirectional = "sum"
    keep_cir: bool = False


@dataclass
class Outcome:
    """What became of a batch.

    Attributes
    ----------
    products : list of Path
        Written files.
    failures : list of str
        One line each: what could not be processed, or only in part.
    notes : list of str
        One line each: what was processed although something was missing.
    """

    products: list[Path] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Job:
    """A recording and the back-to-back it is calibrated with."""

    recording: Recording
    b2b: BackToBack


def gather(
    paths: Sequence[Path],
    *,
    calibration: Path | None = None,
    layout: Path | None = None,
    sounder: Path | None = None,
) -> tuple[list[Job], Outcome]:
    """Open recordings and find the back-to-back of each.

    Parameters
    ----------
    paths : sequence of Path
        Files, one or many positions each.
    calibration : Path, optional
        Native back-to-back file; goes before one inside a recording file.
    layout : Path, optional
        How the files are laid out, for foreign ones.
    sounder : Path, optional
        Sounder description; default for foreign files is the shipped one, for native ones their own.

    Returns
    -------
    jobs : list of Job
    outcome : Outcome
        With the failures so far.

    Raises
    ------
    DataError
        The calibration, the layout or the description cannot be used, so nothing can.
    """
    outcome = Outcome()
    b2b = None if calibration is None else native.back_to_back(calibration)
    jobs: list[Job] = []
    for path in paths:
        try:
            found, inside = open_file(path, layout=layout, sounder=sounder)
            if (own := b2b or inside) is None:
                raise DataError(f"{path}: no back-to-back capture; pass one with --calibration")
        except DataError as error:
            outcome.failures.append(str(error))
            continue
        for item in found:
            if isinstance(item, DataError):
                outcome.failures.append(str(item))
            else:
                jobs.append(Job(item, own))
    return jobs, outcome


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
    described = None if sounder is None else load(sounder)
    if layout is None:
        return open_recordings(path, described), None
    plan = layouts.load(layout)
    base = described or load(shipped.calibration("sounder-132ghz.toml"))
    return foreign.recordings(path, plan, base), foreign.back_to_back(path, plan, base)


def convert_file(path: Path, out: Path, *, layout: Path | None = None, sounder: Path | None = None) -> Outcome:
    """Write the positions of a file as native recordings, and the back-to-back it holds as a native one.

    Parameters
    ----------
    path : Path
        File in any readable format.
    out : Path
        A ``.h5`` file for one position and nothing else; otherwise a folder.

    Returns
    -------
    Outcome

    Raises
    ------
    DataError
        The file cannot be read, or holds more than one file can take.
    """
    found, b2b = open_file(path, layout=layout, sounder=sounder)
    outcome = Outcome(failures=[str(item) for item in found if isinstance(item, DataError)])
    recordings = [item for item in found if not isinstance(item, DataError)]
    single = out.suffix == ".h5"
    if single and (len(recordings) > 1 or b2b is not None):
        raise DataError(f"{path}: holds {len(recordings)} positions and more; pass a folder as --out, not {out}")
    taken: dict[Path, Path] = {}
    for recording in recordings:
        try:
            target = _free(out, recording) if single else _target(recording, out, taken)
            native.write_recording(recording, target, history="sounder convert")
        except DataError as error:
            outcome.failures.append(str(error))
        else:
            outcome.products.append(target)
    if b2b is not None:
        native.write_back_to_back(b2b, out / "back-to-back.h5", history="sounder convert", inputs=[path])
    return outcome


def process(
    jobs: Sequence[Job],
    out: Path,
    *,
    options: Options | None = None,
    outcome: Outcome | None = None,
    progress: Callable[[], None] | None = None,
) -> Outcome:
    """Process recordings into one product a position.

    Parameters
    ----------
    jobs : sequence of Job
        From :func:`gather`.
    out : Path
        Folder of the products, named after the positions.
    options : Options, optional
    outcome : Outcome, optional
        From :func:`gather`; added to.
    progress : callable, optional
        Called after each direction.

    Returns
    -------
    Outcome
    """
    options = options or Options()
    outcome = outcome or Outcome()
    filters: dict[tuple[int, str, float], Deembedding] = {}
    taken: dict[Path, Path] = {}
    for job in jobs:
        recording = job.recording
        key = (id(job.b2b), recording.sounder.model_dump_json(), recording.scale_factor)
        try:
            target = _target(recording, out, taken)
            if key not in filters:
                filters[key] = calibrate(job.b2b, recording)
            groups, problems = position(recording, filters[key], options, progress=progress)
            groups["/"].attrs.update(_origin(job, options))
            write_product(groups, target)
        except DataError as error:
            outcome.failures.append(str(error))
            continue
        outcome.products.append(target)
        outcome.failures.extend(
            f"{recording.source}: {recording.name}: azimuth {p.azimuth:g}, elevation {p.elevation:g}: {p.what}"
            for p in problems
        )
        if recording.missing:
            outcome.notes.append(_missing(recording))
    return outcome


def position(
    recording: Recording,
    filter_: Deembedding,
    options: Options,
    *,
    progress: Callable[[], None] | None = None,
) -> tuple[dict[str, xr.Dataset], list[Problem]]:
    """Process one position.

    Returns
    -------
    groups : dict of str to xarray.Dataset
        Root, ``/daps``, ``/mpc`` and, if kept, ``/cir``.
    problems : list of Problem
        Directions in which something is wrong.

    Raises
    ------
    DataError
        Nothing in the recording can be used.
    """
    cir, problems = impulse_responses(recording, filter_, averaging=options.averaging, progress=progress)
    distance = float(np.linalg.norm(recording.tx_position - recording.rx_position))
    groups = {
        "/": _root(recording, problems),
        "/daps": daps(cir, recording.sounder, omnidirectional=options.omnidirectional),
        "/mpc": extract(cir, filter_, recording.sounder, distance=distance, threshold=options.threshold),
    }
    if options.keep_cir:
        groups["/cir"] = cir
    return groups, problems


def _root(recording: Recording, problems: list[Problem]) -> xr.Dataset:
    metres = {"units": "m"}
    return xr.Dataset(
        {
            f"{end}_position": (
                ("position", "xyz"),
                getattr(recording, f"{end}_position")[None],
                {**metres, "long_name": f"{end.upper()} position, east, north, up"},
            )
            for end in ("tx", "rx")
        },
        coords={"position": ("position", [recording.name]), "xyz": ("xyz", ["east", "north", "up"])},
        attrs={
            "frequency": recording.sounder.carrier.frequency,
            "los": recording.los,
            "sounder": recording.sounder.model_dump_json(),
            "missing_directions": len(recording.missing),
            "problem_directions": len(problems),
        },
    )


def _origin(job: Job, options: Options) -> dict[str, Any]:
    sources = {path for path in (job.recording.source, job.b2b.source) if path.is_file()}
    return provenance("Processed captures of one position", "sounder process", inputs=sources, options=vars(options))


def _target(recording: Recording, out: Path, taken: dict[Path, Path]) -> Path:
    name = re.sub(r"[^\w.+-]+", "_", recording.name).strip("._") or recording.source.stem
    target = out / f"{name}.h5"
    if target in taken:
        raise DataError(
            f"{recording.source}: position {recording.name} was already read from {taken[target]}; "
            "give the positions different names or process them into different folders"
        )
    taken[target] = recording.source
    return _free(target, recording)


def _free(target: Path, recording: Recording) -> Path:
    """Refuse to replace the input."""
    if target.exists() and target.samefile(recording.source):
        raise DataError(f"{recording.source}: the output would replace its input; choose another --out")
    return target


def _missing(recording: Recording) -> str:
    missing = recording.missing
    shown = ", ".join(f"({a:g}, {e:g})" for a, e in missing[:3])
    more = f" and {len(missing) - 3} more" if len(missing) > 3 else ""
    return (
        f"{recording.source}: {recording.name}: {len(missing)} of "
        f"{len(recording.sounder.scan.azimuth) * len(recording.sounder.scan.elevation)} directions missing: "
        f"(azimuth, elevation) {shown}{more}; processed without them"
    )
