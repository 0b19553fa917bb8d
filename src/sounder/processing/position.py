"""One position: from its recording to its product, or to what is wrong with it."""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from erm.common.errors import DataError
from erm.common.storage import open_group, provenance, write_product
from sounder.cir.deembedding import Deembedding
from sounder.cir.impulse_response import Problem, calibrate, impulse_responses
from sounder.cir.power_spectrum import daps
from sounder.mpc.extract import extract
from sounder.options import Options
from sounder.processing import remarks
from sounder.processing.jobs import Job
from sounder.recordings.recording import Recording


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
    already : int
        How many of the products were there and were not made again.
    """

    products: list[Path] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    already: int = 0


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
        groups, problems = products_of(recording, filters.of(job), options, threads=threads)
        said = {"failures": remarks.failures(recording, groups, problems), "notes": remarks.notes(recording, groups)}
        groups["/"].attrs.update(_origin(job, options), **{name: json.dumps(lines) for name, lines in said.items()})
        write_product(groups, target)
    except DataError as error:
        return Outcome(failures=[str(error)])
    return _outcome(recording, target, said)


def made_before(job: Job, target: Path, options: Options) -> Outcome | None:
    """What became of a position whose product is there and would be made the same again; None if it is to be made.

    The same is made of the same input files with the same options by the same version of the software. Files are the
    same if their hashes are; sizes and times could be those of other contents.
    """
    recording = job.recording
    try:
        root = open_group(target)
        said = {name: list(json.loads(root.attrs[name])) for name in ("failures", "notes")}
        found = root["position"].values.tolist(), *(root[f"{end}_position"].values.tolist() for end in ("tx", "rx"))
    except (DataError, KeyError, TypeError, ValueError):  # of another version, or none of ours
        return None
    # a file can hold many positions, and a description what is in no input: the cut of an antenna
    asked = [recording.name], [recording.tx_position.tolist()], [recording.rx_position.tolist()]
    origin = _origin(job, options) | {"sounder": recording.sounder.model_dump_json()}
    if found != asked or any(root.attrs.get(name) != value for name, value in origin.items()):
        return None
    return _outcome(recording, target, said, already=1)


def _outcome(recording: Recording, target: Path, said: dict[str, list[str]], already: int = 0) -> Outcome:
    lines = {name: [f"{recording.source}: {recording.name}: {line}" for line in told] for name, told in said.items()}
    return Outcome(products=[target], failures=lines["failures"], notes=lines["notes"], already=already)


def products_of(
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
        "/mpc": extract(
            cir,
            filter_,
            recording.sounder,
            distance=distance,
            threshold=options.threshold,
            method=options.method,
            time=recording.time,
        ),
    }
    if options.keep_cir:
        groups["/cir"] = cir
    return groups, problems


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
    read = (job.recording.source, job.b2b.source, job.source.layout, job.source.sounder)
    sources = {path for path in read if path is not None and path.is_file()}
    return provenance("Processed captures of one position", "sounder process", inputs=sources, options=vars(options))
