"""What is said of a processed position: directions spoiled or missing, phases that drift, gains that cannot be."""

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr

from erm.common.constants import c
from sounder.cir.impulse_response import Problem
from sounder.recordings.recording import Recording

INCOHERENT = 0.5
"""Share of the strongest direction's power kept by coherent averaging under which a note is made."""
EXCESS = 3.0
"""How far an MPC may stand over free space, beyond two of its standard deviations [dB]."""
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
    kinds = dict.fromkeys((problem.what, problem.action) for problem in problems)
    found = [_spoiled(recording, problems, *kind) for kind in kinds]
    if (impossible := _over_free_space(groups["/mpc"], recording)) is not None:
        found.append(impossible)
    return found


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
    return found


def _spoiled(recording: Recording, problems: Sequence[Problem], what: str, then: str) -> str:
    """One kind of problem, with the share of the samples where that is not all of them."""
    alike = [problem for problem in problems if (problem.what, problem.action) == (what, then)]
    worst = max(problem.share for problem in alike)
    share = "" if worst == 1 else f" (up to {100 * worst:.1f} %)"
    recorded = int(recording.valid.sum())
    where = _named([(problem.azimuth, problem.elevation) for problem in alike])
    return f"{what}{share} in {len(alike)} of {recorded} directions: {where}; {then}"


def _named(directions: Sequence[tuple[float, float]]) -> str:
    shown = ", ".join(f"({a:g}, {e:g})" for a, e in directions[:SHOWN])
    more = f" and {len(directions) - SHOWN} more" if len(directions) > SHOWN else ""
    return f"(azimuth, elevation) {shown}{more}"


def _over_free_space(mpc: xr.Dataset, recording: Recording) -> str | None:
    """Tell of the MPC that stands highest over free space, if that is more than can be.

    A path of length ``c delay`` between isotropic antennas has at most the gain ``(c / (4 pi f c delay))**2``: plane
    and convex faces, edges and air only take from it. Where one has more, its delay or its gain is wrong, and with it
    all delays or all gains of the position: a failure, not a note, although the product is there to look into. Two
    equal paths in step that cannot be told apart stand 6 dB over it: a false alarm that is rarer than a wrong position.

    The strongest path gets no such allowance where it came before the direct one and so was taken for one a period
    later: reflected, it would have less than free space over so long a way.

    Source: Friis, Proc. IRE 34 (1946) 254-256.
    """
    if not mpc.sizes["mpc"]:
        return None
    frequency, period = recording.sounder.carrier.frequency, recording.sounder.waveform.period
    delay, gain = mpc["delay"].values, mpc["path_gain"].values
    excess = gain + 20 * np.log10(4 * np.pi * frequency * np.maximum(delay, np.finfo(float).tiny))
    doubt = np.nan_to_num(mpc["path_gain_std"].values)
    sure = excess - EXCESS - 2 * doubt
    best = int(np.argmax(gain - doubt))
    if np.linalg.norm(recording.tx_position - recording.rx_position) / c < period <= delay[best]:
        sure[best] = excess[best]
    worst = int(np.argmax(sure))
    if sure[worst] <= 0:
        return None
    return (
        f"the MPC at {delay[worst] * 1e9:.2f} ns has a path gain of {gain[worst]:.1f} dB; free space over "
        f"{delay[worst] * c:.1f} m allows {gain[worst] - excess[worst]:.1f} dB: check the positions of TX and RX, the "
        "calibration and the antenna gains; the product is not to be trusted"
    )


def _coherence(daps: xr.Dataset) -> float:
    """Coherence of the direction with the most power; 1 where it was not measured."""
    if "coherence" not in daps:
        return 1.0
    strongest = int(np.nanargmax(daps["daps"].max("delay").values))
    return float(daps["coherence"].values.flat[strongest])
