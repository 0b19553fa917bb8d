"""What is said of a position that was processed: directions spoiled or missing, phases that drift."""

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr

from sounder.correlate import Problem
from sounder.recording import Recording

INCOHERENT = 0.5
"""Share of the strongest direction's power kept by coherent averaging under which a note is made."""
SHOWN = 3
"""Directions named before the others are counted."""


def failures(recording: Recording, groups: Mapping[str, xr.Dataset], problems: Sequence[Problem]) -> list[str]:
    """One line for each kind of failure in a position whose product was written all the same.

    Parameters
    ----------
    recording : Recording
    groups : mapping of str to xarray.Dataset
        The product.
    problems : sequence of Problem
        Of the directions.
    """
    kinds = dict.fromkeys((problem.what, problem.then) for problem in problems)
    return [f"{_who(recording)}: {_spoiled(recording, problems, *kind)}" for kind in kinds]


def notes(recording: Recording, groups: Mapping[str, xr.Dataset]) -> list[str]:
    """One line for each thing that was missing, and without which the position was processed."""
    found = []
    if missing := recording.missing:
        scan = recording.sounder.scan
        found.append(
            f"{len(missing)} of {len(scan.azimuth) * len(scan.elevation)} directions missing: {_named(missing)}; "
            "processed without them"
        )
    if not groups["/mpc"].attrs["complete"]:
        found.append("more paths than an MPC table holds; the weakest are left out")
    kept = _coherence(groups["/daps"])
    if kept < INCOHERENT:
        found.append(
            f"coherent averaging keeps {100 * kept:.0f} % of the strongest direction's power; "
            "the phase drifts between snapshots: try --averaging phase-aligned"
        )
    return [f"{_who(recording)}: {note}" for note in found]


def _who(recording: Recording) -> str:
    return f"{recording.source}: {recording.name}"


def _spoiled(recording: Recording, problems: Sequence[Problem], what: str, then: str) -> str:
    """One kind of problem, with the share of the samples where that is not all of them."""
    alike = [problem for problem in problems if (problem.what, problem.then) == (what, then)]
    worst = max(problem.share for problem in alike)
    share = "" if worst == 1 else f" (up to {100 * worst:.1f} %)"
    recorded = int(recording.valid.sum())
    where = _named([(problem.azimuth, problem.elevation) for problem in alike])
    return f"{what}{share} in {len(alike)} of {recorded} directions: {where}; {then}"


def _named(directions: Sequence[tuple[float, float]]) -> str:
    shown = ", ".join(f"({a:g}, {e:g})" for a, e in directions[:SHOWN])
    more = f" and {len(directions) - SHOWN} more" if len(directions) > SHOWN else ""
    return f"(azimuth, elevation) {shown}{more}"


def _coherence(daps: xr.Dataset) -> float:
    """Coherence of the direction with the most power; 1 where it was not measured."""
    if "coherence" not in daps:
        return 1.0
    strongest = int(np.nanargmax(daps["daps"].max("delay").values))
    return float(daps["coherence"].values.flat[strongest])
