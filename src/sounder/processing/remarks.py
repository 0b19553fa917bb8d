"""Remarks about a processed position as a whole: missing directions, phase drift, impossible gains."""

from collections.abc import Mapping

import numpy as np
import xarray as xr

from erm.common.constants import c
from sounder.cir.deembedding import Deembedding
from sounder.instrument.antenna_cut import widest_gap
from sounder.instrument.description import Sounder
from sounder.quality.line_of_sight import LEAST_SNR, remarks_on_line_of_sight
from sounder.quality.noise_level import remarks_on_noise_level
from sounder.recordings.recording import Recording
from sounder.remark import Code, Remark, named

MIN_COHERENCE = 0.5
"""Share of the power of the strongest direction that averaging must keep. Half: a loss of 3 dB. Chosen; not derived."""
LOST_COHERENCE = {
    "coherent": (Code.PHASE_DRIFT, "the phase drifts between snapshots"),
    "phase-aligned": (Code.CHANNEL_CHANGES, "the channel changes between snapshots"),
}
"""Kind of remark and cause by averaging, where it keeps less."""
FREE_SPACE_MARGIN = 3.0
"""Gain over free space that an MPC may have, besides two of its standard deviations [dB]. Chosen; not derived."""


def remarks_on_position(recording: Recording, groups: Mapping[str, xr.Dataset], filter_: Deembedding) -> list[Remark]:
    """Remarks about a position as a whole. Its product is written nevertheless.

    Parameters
    ----------
    recording : Recording
    groups : mapping of str to xarray.Dataset
        Groups of the product.
    filter_ : Deembedding
        The filter that made them.
    """
    remarks = remarks_on_line_of_sight(recording, groups["/mpc"], groups["/daps"])
    if recording.sounder.clock.start == "arbitrary" and recording.los != 1:
        remarks.append(Remark(Code.NO_CLOCK))
    remarks += remarks_on_noise_level(groups["/daps"], filter_, recording) + remarks_on_cuts(recording.sounder)
    if (impossible := over_free_space(groups["/mpc"], recording)) is not None:
        remarks.append(impossible)
    if missing := recording.missing:
        scan = recording.sounder.scan
        every = len(scan.azimuth) * len(scan.elevation)
        detail = f"{len(missing)} of {every} directions missing: {named(missing)}"
        remarks.append(Remark(Code.DIRECTIONS_MISSING, figure=len(missing) / every, bound=0.0, detail=detail))
    if not groups["/mpc"].attrs["complete"]:
        remarks.append(Remark(Code.TABLE_FULL))
    kept = _coherence(groups["/daps"])
    if kept < MIN_COHERENCE:
        averaging = groups["/daps"].attrs["averaging"]
        code, why = LOST_COHERENCE[averaging]
        detail = f"{averaging} averaging keeps {100 * kept:.0f} % of the power of the strongest direction; {why}"
        remarks.append(Remark(code, figure=kept, bound=MIN_COHERENCE, detail=detail))
    return remarks


def remarks_on_cuts(sounder: Sounder) -> list[Remark]:
    """Compare what the rows of measured cuts leave open between them with the error that the pattern may have."""
    remarks = []
    for end, antenna in (("tx_antenna", sounder.tx_antenna), ("rx_antenna", sounder.rx_antenna)):
        gap, bound = widest_gap(antenna), 20 * np.log10(1 + antenna.pattern_error[0])
        if gap is not None and gap.error > bound:
            detail = (
                f"{end}: the cut in {gap.cut} has rows {gap.step:g} degree apart, which leave its gain between them "
                f"open by about {gap.error:.2g} dB; gain_error allows {bound:.2g} dB"
            )
            remarks.append(Remark(Code.PATTERN_COARSE, figure=gap.error, bound=bound, detail=detail))
    return remarks


def over_free_space(mpc: xr.Dataset, recording: Recording) -> Remark | None:
    """Remark about the MPC whose gain exceeds free space most, if no path can have this gain.

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
    detail = (
        f"the MPC at {delay[worst] * 1e9:.2f} ns has a path gain of {gain[worst]:.1f} dB; free space over "
        f"{delay[worst] * c:.1f} m allows {gain[worst] - excess[worst]:.1f} dB"
    )
    return Remark(Code.OVER_FREE_SPACE, figure=excess[worst], bound=excess[worst] - beyond[worst], detail=detail)


def _coherence(daps: xr.Dataset) -> float:
    """Coherence of the direction with the most power; 1 if it was not measured, or is that of noise."""
    if "coherence" not in daps:
        return 1.0
    peak = daps["daps"].max("delay").values
    strongest = int(np.nanargmax(peak))
    if (peak - daps["noise_floor"].values).flat[strongest] < LEAST_SNR:
        return 1.0
    return float(daps["coherence"].values.flat[strongest])
