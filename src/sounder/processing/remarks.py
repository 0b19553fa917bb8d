"""Failures and notes about a processed position: bad or missing directions, phase drift, impossible gains."""

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr

from erm.common.constants import c
from sounder.cir.impulse_response import Problem
from sounder.recordings.recording import Recording

MIN_COHERENCE = 0.5
"""Share of the power of the strongest direction that coherent averaging must keep. Half: a loss of 3 dB. Chosen; not
derived."""
FREE_SPACE_MARGIN = 3.0
"""Gain over free space that an MPC may have, besides two of its standard deviations [dB]. Chosen; not derived."""
MAX_NAMED_DIRECTIONS = 3
"""Directions that a line names; it counts the others. Chosen; not derived."""


def failures(recording: Recording, groups: Mapping[str, xr.Dataset], problems: Sequence[Problem]) -> list[str]:
    """One line for each kind of failure in a position. Its product is written nevertheless.

    Parameters
    ----------
    recording : Recording
    groups : mapping of str to xarray.Dataset
        Groups of the product.
    problems : sequence of Problem
        Problems of single directions.
    """
    kinds = dict.fromkeys((problem.what, problem.action) for problem in problems)
    lines = [_problem_line(recording, problems, *kind) for kind in kinds]
    if (impossible := _over_free_space(groups["/mpc"], recording)) is not None:
        lines.append(impossible)
    return lines


def notes(recording: Recording, groups: Mapping[str, xr.Dataset]) -> list[str]:
    """One line for each thing without which the position was processed."""
    lines = []
    if missing := recording.missing:
        scan = recording.sounder.scan
        lines.append(
            f"{len(missing)} of {len(scan.azimuth) * len(scan.elevation)} directions missing: {_named(missing)}; "
            "processed without them"
        )
    if not groups["/mpc"].attrs["complete"]:
        lines.append("more paths than an MPC table holds; the weakest are left out")
    kept = _coherence(groups["/daps"])
    if kept < MIN_COHERENCE:
        lines.append(
            f"coherent averaging keeps {100 * kept:.0f} % of the power of the strongest direction; "
            "the phase drifts between snapshots: try --averaging phase-aligned"
        )
    return lines


def _problem_line(recording: Recording, problems: Sequence[Problem], what: str, action: str) -> str:
    """One kind of problem, with the directions that have it."""
    alike = [problem for problem in problems if (problem.what, problem.action) == (what, action)]
    worst = max(problem.share for problem in alike)
    share = "" if worst == 1 else f" (up to {100 * worst:.1f} %)"
    recorded = int(recording.valid.sum())
    where = _named([(problem.azimuth, problem.elevation) for problem in alike])
    return f"{what}{share} in {len(alike)} of {recorded} directions: {where}; {action}"


def _named(directions: Sequence[tuple[float, float]]) -> str:
    shown = ", ".join(f"({a:g}, {e:g})" for a, e in directions[:MAX_NAMED_DIRECTIONS])
    more = f" and {len(directions) - MAX_NAMED_DIRECTIONS} more" if len(directions) > MAX_NAMED_DIRECTIONS else ""
    return f"(azimuth, elevation) {shown}{more}"


def _over_free_space(mpc: xr.Dataset, recording: Recording) -> str | None:
    """Line about the MPC whose gain exceeds free space most, if no path can have this gain.

    A path of length ``c delay`` between isotropic antennas has at most the gain ``(c / (4 pi f c delay))**2``: plane
    and convex faces, edges and air reduce it. If an MPC has more, its delay or its gain is wrong, and so are all delays
    or all gains of the position. That is a failure, not a note. Two equal paths in phase that are not resolved exceed
    free space by 6 dB: a false alarm, which is rarer than a wrong position.

    The strongest path has no margin if it arrived before the direct path could, and so was taken to be a period later:
    a reflected path has less than the gain of free space over so long a distance.

    Source: Friis, Proc. IRE 34 (1946) 254-256.
    """
    if not mpc.sizes["mpc"]:
        return None
    frequency, period = recording.sounder.carrier.frequency, recording.sounder.waveform.period
    delay, gain = mpc["delay"].values, mpc["path_gain"].values
    excess = gain + 20 * np.log10(4 * np.pi * frequency * np.maximum(delay, np.finfo(float).tiny))
    std = np.nan_to_num(mpc["path_gain_std"].values)
    beyond = excess - FREE_SPACE_MARGIN - 2 * std
    best = int(np.argmax(gain - std))
    if np.linalg.norm(recording.tx_position - recording.rx_position) / c < period <= delay[best]:
        beyond[best] = excess[best]
    worst = int(np.argmax(beyond))
    if beyond[worst] <= 0:
        return None
    return (
        f"the MPC at {delay[worst] * 1e9:.2f} ns has a path gain of {gain[worst]:.1f} dB; free space over "
        f"{delay[worst] * c:.1f} m allows {gain[worst] - excess[worst]:.1f} dB: check the positions of TX and RX, the "
        "calibration and the antenna gains; do not trust the product"
    )


def _coherence(daps: xr.Dataset) -> float:
    """Coherence of the direction with the most power; 1 if it was not measured."""
    if "coherence" not in daps:
        return 1.0
    strongest = int(np.nanargmax(daps["daps"].max("delay").values))
    return float(daps["coherence"].values.flat[strongest])
