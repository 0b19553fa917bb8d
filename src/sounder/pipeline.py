"""Recordings to products: each position on its own, what fails is named and the rest is done."""

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from erm.errors import DataError
from erm.storage import provenance, write_product
from sounder.calibration import Deembedding
from sounder.correlate import Averaging, Problem, calibrate, impulse_responses
from sounder.daps import Omnidirectional, daps
from sounder.intake import Job
from sounder.mpc import Threshold, extract
from sounder.recording import Recording

INCOHERENT = 0.5
"""Share of the strongest direction's power kept by coherent averaging under which a note is made."""


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

    def add(self, other: "Outcome") -> None:
        """Add what became of another part of the batch."""
        self.products += other.products
        self.failures += other.failures
        self.notes += other.notes


class Targets:
    """File names in one folder; no two outputs get the same, none that of an input.

    Parameters
    ----------
    out : Path
        The folder.
    inputs : iterable of Path
        Files that are read, and so never written to.
    """

    def __init__(self, out: Path, inputs: Iterable[Path]) -> None:
        self._out = out
        self._inputs = {path.resolve() for path in inputs}
        self._taken: dict[Path, str] = {}

    def claim(self, recording: Recording, name: str | None = None) -> Path:
        """Name the file of a position, after the position unless a name is given.

        Raises
        ------
        DataError
            Another position has the name, or it is that of an input.
        """
        safe = re.sub(r"[^\w.+-]+", "_", recording.name).strip("._") or recording.source.stem
        return self.reserve(name or safe, f"{recording.source}: position {recording.name}")

    def reserve(self, name: str, who: str) -> Path:
        """Name a file ``name.h5`` for ``who``, who is named in errors.

        Raises
        ------
        DataError
            Somebody else has the name, or it is that of an input.
        """
        target = self._out / f"{name}.h5"
        if target in self._taken:
            raise DataError(
                f"{who}: {target} is already taken by {self._taken[target]}; "
                "give the positions different names or process them into different folders"
            )
        if target.resolve() in self._inputs:
            raise DataError(f"{who}: the output {target} would replace an input; choose another --out")
        self._taken[target] = who
        return target


def process(
    jobs: Sequence[Job],
    out: Path,
    *,
    options: Options | None = None,
    threads: int | None = None,
    workers: int = 1,
    scheduler: str | None = None,
    progress: Callable[[], None] | None = None,
) -> Outcome:
    """Process recordings into one product a position.

    The products are the same, to the last byte, for any number of threads and workers.

    Parameters
    ----------
    jobs : sequence of Job
        From :func:`sounder.intake.gather`.
    out : Path
        Folder of the products, named after the positions.
    options : Options, optional
    threads : int, optional
        Directions worked on at a time in one process; default one a processor.
    workers : int
        Processes on this machine, by dask.
    scheduler : str, optional
        Address of a running dask scheduler, such as ``tcp://host:8786``; its workers must see the same files.
    progress : callable, optional
        Called after each position.

    Returns
    -------
    Outcome
        In the order of the jobs.

    Raises
    ------
    DataError
        The dask scheduler cannot be reached, or dask is not installed.
    """
    options = options or Options()
    targets = Targets(out, {path for job in jobs for path in (job.recording.source, job.b2b.source)})
    outcome = Outcome()
    pairs: list[tuple[Job, Path]] = []
    for job in jobs:
        try:
            pairs.append((job, targets.claim(job.recording)))
        except DataError as error:
            outcome.failures.append(str(error))
    parts: Iterable[Outcome]
    if workers > 1 or scheduler is not None:
        from sounder.cluster import run  # distributed is optional and slow to import

        parts = run(pairs, options, workers=workers, threads=threads, scheduler=scheduler)
    else:
        filters = Filters()
        parts = (process_position(job, target, options, filters=filters, threads=threads) for job, target in pairs)
    for part in parts:
        outcome.add(part)
        if progress is not None:
            progress()
    return outcome


class Filters:
    """De-embedding filters made so far; the positions of a campaign share one."""

    def __init__(self) -> None:
        self._made: dict[tuple[Path, str, float], Deembedding] = {}

    def of(self, job: Job) -> Deembedding:
        """Return the filter of a job, made when it is first asked for."""
        recording = job.recording
        key = (job.b2b.source, recording.sounder.model_dump_json(), recording.scale_factor)
        if key not in self._made:
            self._made[key] = calibrate(job.b2b, recording)
        return self._made[key]


def process_position(
    job: Job, target: Path, options: Options, *, filters: Filters, threads: int | None = None
) -> Outcome:
    """Process one position into its product; what is wrong with it is told, not raised."""
    recording = job.recording
    try:
        groups, problems = position(recording, filters.of(job), options, threads=threads)
        groups["/"].attrs.update(_origin(job, options))
        write_product(groups, target)
    except DataError as error:
        return Outcome(failures=[str(error)])
    who = f"{recording.source}: {recording.name}"
    outcome = Outcome(products=[target])
    outcome.failures += [f"{who}: azimuth {p.azimuth:g}, elevation {p.elevation:g}: {p.what}" for p in problems]
    if recording.missing:
        outcome.notes.append(_missing(recording, who))
    if not groups["/mpc"].attrs["complete"]:
        outcome.notes.append(
            f"{who}: more paths than an MPC table holds; the weakest are left out"
        )
    kept = _coherence(groups["/daps"])
    if kept < INCOHERENT:
        outcome.notes.append(
            f"{who}: coherent averaging keeps {100 * kept:.0f} % of the strongest direction's power; "
            "the phase drifts between snapshots: try --averaging phase-aligned"
        )
    return outcome


def position(
    recording: Recording, filter_: Deembedding, options: Options, *, threads: int | None = None
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
    cir, problems = impulse_responses(recording, filter_, averaging=options.averaging, threads=threads)
    distance = float(np.linalg.norm(recording.tx_position - recording.rx_position))
    groups = {
        "/": _root(recording, problems),
        "/daps": daps(cir, recording.sounder, omnidirectional=options.omnidirectional),
        "/mpc": extract(cir, filter_, recording.sounder, distance=distance, threshold=options.threshold),
    }
    if options.keep_cir:
        groups["/cir"] = cir
    return groups, problems


def _coherence(daps_: xr.Dataset) -> float:
    """Coherence of the direction with the most power; 1 where it was not measured."""
    if "coherence" not in daps_:
        return 1.0
    strongest = int(np.nanargmax(daps_["daps"].max("delay").values))
    return float(daps_["coherence"].values.flat[strongest])


def _root(recording: Recording, problems: list[Problem]) -> xr.Dataset:
    return xr.Dataset(
        {
            f"{end}_position": (
                ("position", "xyz"),
                getattr(recording, f"{end}_position")[None],
                {"units": "m", "long_name": f"{end.upper()} position, east, north, up"},
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


def _missing(recording: Recording, who: str) -> str:
    missing = recording.missing
    shown = ", ".join(f"({a:g}, {e:g})" for a, e in missing[:3])
    more = f" and {len(missing) - 3} more" if len(missing) > 3 else ""
    wanted = len(recording.sounder.scan.azimuth) * len(recording.sounder.scan.elevation)
    return (
        f"{who}: {len(missing)} of {wanted} directions missing: (azimuth, elevation) {shown}{more}; "
        "processed without them"
    )
