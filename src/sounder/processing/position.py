"""One position: from its recording to its product, or to an error."""

import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from erm.common.constants import c
from erm.common.errors import DataError, internal_error
from erm.common.storage import open_groups, provenance, sha256, write_product
from sounder.cir.deembedding import Deembedding
from sounder.cir.first_arrival import place_first_arrival
from sounder.cir.impulse_response import calibrate
from sounder.cir.power_spectrum import daps
from sounder.mpc.extract import extract_mpcs
from sounder.mpc.omnidirectional_pdp import with_synthesis
from sounder.options import Options
from sounder.processing.departures import checked_responses
from sounder.processing.jobs import Job
from sounder.processing.remarks import remarks_on_position
from sounder.quality.calibration import check_back_to_back
from sounder.quality.table import read_remarks, tabulate_remarks
from sounder.recordings.recording import Recording
from sounder.remark import Remark, doubts, lines

FIRST_ARRIVAL = "first arrival, placed at the distance of the antennas"
"""What delays refer to without a common clock."""
EVIDENCE = "shared_evidence"
"""Attribute of products: log-likelihood ratios of faults that all positions share; their sums decide."""


@dataclass
class Outcome:
    """Result of processing one or many positions.

    Attributes
    ----------
    products : list of Path
        Products, written or kept.
    failures : list of str
        One line for each position, or part of one, that could not be processed.
    notes : list of str
        One line for each position that was processed although something was missing.
    already : int
        Number of the products that existed and were kept.
    internal : bool
        Whether a position failed by an error of this software.
    evidence : list of float
        Of one position: what it adds to the evidence of faults that all positions share, from
        :func:`sounder.quality.quadrature.quadrature_evidence`.
    """

    products: list[Path] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    already: int = 0
    internal: bool = False
    evidence: list[float] = field(default_factory=list)


class FilterCache:
    """De-embedding filters, made once for all positions with the same back-to-back, description and scale factor."""

    def __init__(self) -> None:
        self._made: dict[tuple[Path, str, float, bool], tuple[Deembedding, list[Remark]]] = {}
        self._making = threading.Lock()

    def get(self, job: Job, *, trust_all: bool = False) -> tuple[Deembedding, list[Remark]]:
        """Filter for a job, and what is wrong with the back-to-back that it is made from."""
        recording = job.recording
        key = (job.b2b.source, recording.sounder.model_dump_json(), recording.scale_factor, trust_all)
        with self._making:
            if key not in self._made:
                checked = check_back_to_back(job.b2b, recording.sounder, trust_all=trust_all)
                self._made[key] = calibrate(checked.usable, recording), checked.remarks
            return self._made[key]


def process_position(
    job: Job, target: Path, options: Options, *, filters: FilterCache, threads: int | None = None
) -> Outcome:
    """Process one position into its product. Errors of its data are returned, not raised."""
    recording = job.recording
    try:
        filter_, of_calibration = filters.get(job, trust_all=options.trust_all)
        with _hashed_meanwhile(_inputs(job)):
            groups, remarks = process_recording(
                recording, filter_, options, threads=threads, of_calibration=of_calibration
            )
        groups["/"].attrs.update(_provenance(job, options))
        write_product(groups, target)
    except DataError as error:
        return Outcome(failures=[str(error)])
    except Exception as error:  # whatever is wrong with one position must not end the others
        where, enough = f"{recording.source}: {recording.name}", not isinstance(error, MemoryError)
        line = internal_error(error) if enough else "the memory of this machine is not enough"
        return Outcome(failures=[f"{where}: {line}"], internal=enough)
    return _outcome(job, target, remarks, groups["/"].attrs[EVIDENCE])


def existing_product(job: Job, target: Path, options: Options) -> Outcome | None:
    """Outcome of a position whose product exists and would be made the same again; None if it must be made.

    It is the same if input files, options and the version of the software are the same. Files are compared by their
    SHA-256, since different contents can have one size and time.
    """
    recording = job.recording
    try:
        root, quality = open_groups(target, "/", "/quality")
        evidence = root.attrs[EVIDENCE]
        remarks = read_remarks(quality)
        found = root["position"].values.tolist(), *(root[f"{end}_position"].values.tolist() for end in ("tx", "rx"))
        origin = _provenance(job, options) | {"sounder": recording.sounder.model_dump_json()}
    except (DataError, KeyError, TypeError, ValueError):  # made by another version or software, or an input is gone
        return None
    # a file can hold many positions, and a description can hold what is in no input: the cut of an antenna
    expected = [recording.name], [recording.tx_position.tolist()], [recording.rx_position.tolist()]
    if found != expected or any(root.attrs.get(name) != value for name, value in origin.items()):
        return None
    return _outcome(job, target, remarks, evidence, already=1)


def _outcome(job: Job, target: Path, remarks: list[Remark], evidence: Sequence[float], already: int = 0) -> Outcome:
    recording = job.recording
    recorded = int(recording.valid.sum())
    named: dict[bool, list[str]] = {True: [], False: []}
    for of_calibration, who in ((True, f"{job.b2b.source}"), (False, f"{recording.source}: {recording.name}")):
        alike = [remark for remark in remarks if remark.code.value.of_calibration == of_calibration]
        for failures, found in named.items():
            found += [f"{who}: {line}" for line in lines(alike, recorded, failures=failures)]
    return Outcome([target], named[True], named[False], already, evidence=[float(value) for value in evidence])


def process_recording(
    recording: Recording,
    filter_: Deembedding,
    options: Options,
    *,
    threads: int | None = None,
    of_calibration: Sequence[Remark] = (),
) -> tuple[dict[str, xr.Dataset], list[Remark]]:
    """Process one position in memory.

    Parameters
    ----------
    recording : Recording
    filter_ : Deembedding
        From :func:`sounder.calibrate`.
    options : Options
    threads : int, optional
        As for :func:`sounder.impulse_responses`.
    of_calibration : sequence of Remark
        What is wrong with the back-to-back of the filter.

    Returns
    -------
    groups : dict of str to xarray.Dataset
        Groups of the product: ``/``, ``/daps``, ``/mpc``, ``/quality`` and, with ``options.keep_cir``, ``/cir``.
    remarks : list of Remark
        What is wrong with the position and its directions, as in ``/quality``.

    Raises
    ------
    DataError
        No direction of the recording can be used.
    """
    cir, remarks = checked_responses(recording, filter_, options, threads=threads)
    distance = float(np.linalg.norm(recording.tx_position - recording.rx_position))
    arbitrary = recording.sounder.clock.start == "arbitrary"
    if arbitrary:
        cir = place_first_arrival(cir, distance)
    mpcs = extract_mpcs(
        cir,
        filter_,
        recording.sounder,
        distance=distance,
        threshold=options.threshold,
        method=options.method,
        time=recording.time,
    )
    _widen_delays(mpcs, cir.attrs["drift_std"])
    if arbitrary:
        cir = _refer_to_first_arrival(cir, mpcs, distance)
    groups = {
        "/": _root(recording, remarks).assign_attrs({EVIDENCE: cir.attrs["evidence"]}),
        "/daps": _daps(cir, mpcs, recording, filter_, options),
        "/mpc": mpcs,
    }
    remarks += [*of_calibration, *remarks_on_position(recording, groups, filter_)]
    if options.trust_all:
        groups["/"].attrs[EVIDENCE] = [0.0]
    else:
        groups["/"].attrs["doubts"] = " ".join(doubts(remarks))
    groups["/quality"] = tabulate_remarks(remarks)
    if options.keep_cir:
        groups["/cir"] = cir
    return groups, remarks


def _daps(
    cir: xr.Dataset, mpcs: xr.Dataset, recording: Recording, filter_: Deembedding, options: Options
) -> xr.Dataset:
    """DAPS with the omnidirectional PDP of the options."""
    if options.omnidirectional == "synthesis":
        spectrum = with_synthesis(daps(cir, recording.sounder), mpcs, filter_)
    else:
        spectrum = daps(cir, recording.sounder, omnidirectional=options.omnidirectional)
    return spectrum.assign_attrs(pulse_energy=float(np.sum(np.abs(filter_.pulse) ** 2)))


def _refer_to_first_arrival(cir: xr.Dataset, mpc: xr.Dataset, distance: float) -> xr.Dataset:
    """Move delays so that the earliest MPC is at the delay of the direct path; that of its error is added to all."""
    mpc.attrs["delay_reference"] = cir.attrs["delay_reference"] = FIRST_ARRIVAL
    if not mpc.sizes["mpc"]:
        return cir
    first = int(np.argmin(mpc["delay"].values))
    moved, std = distance / c - float(mpc["delay"].values[first]), float(mpc["delay_std"].values[first])
    mpc["delay"].values[:] += moved
    _widen_delays(mpc, std)
    delay = cir["delay"].values
    turns = np.exp(-2j * np.pi * np.fft.fftfreq(delay.size, delay[1] - delay[0]) * moved)
    shifted = np.fft.ifft(np.fft.fft(cir["cir"].values) * turns).astype(np.complex64)
    return cir.assign(cir=(cir["cir"].dims, shifted, cir["cir"].attrs))


def _widen_delays(mpc: xr.Dataset, std: float) -> None:
    """Add the standard deviation [s] that all delays of a position have besides."""
    mpc["delay_std"].values[:] = np.hypot(mpc["delay_std"].values, std)
    mpc["covariance"].values[:, 0, 0] += std**2


def _root(recording: Recording, remarks: list[Remark]) -> xr.Dataset:
    return xr.Dataset(
        {
            f"{end}_position": (
                ("position", "xyz"),
                getattr(recording, f"{end}_position")[None],
                {"units": "m", "long_name": f"{end.upper()} position: east, north, up"},
            )
            for end in ("tx", "rx")
        },
        coords={"position": ("position", [recording.name]), "xyz": ("xyz", ["east", "north", "up"])},
        attrs={
            "frequency": recording.sounder.carrier.frequency,
            "los": recording.los,
            "delay_reference": FIRST_ARRIVAL if recording.sounder.clock.start == "arbitrary" else "transmission",
            "sounder": recording.sounder.model_dump_json(),
            "recorded_directions": int(recording.valid.sum()),
            "missing_directions": len(recording.missing),
            "doubts": "",
            "problem_directions": len({(r.azimuth, r.elevation) for r in remarks if r.of_direction}),
        },
    )


def _inputs(job: Job) -> set[Path]:
    """Files that a position is made of."""
    return {job.recording.source, job.b2b.source, *job.recording.inputs} | job.source.explained.files


@contextmanager
def _hashed_meanwhile(paths: set[Path]) -> Iterator[None]:
    """Hash files while they are processed: what one reads from disk, the other finds in memory."""
    with ThreadPoolExecutor(1) as hashing:
        hashes = [hashing.submit(sha256, path) for path in paths]
        yield
        for each in hashes:
            each.result()


def _provenance(job: Job, options: Options) -> dict[str, Any]:
    title = "Processed captures of one position"
    return provenance(title, "sounder process", inputs=_inputs(job), options=vars(options))
