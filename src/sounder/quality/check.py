"""All checks of one position, between its impulse responses and its DAPS."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import xarray as xr

from erm.common.errors import DataError
from sounder.cir.deembedding import Deembedding
from sounder.quality.noise_floor import SIGNAL_TO_PEAK
from sounder.quality.overlap import check_overlaps
from sounder.quality.scan import Scan
from sounder.quality.snapshots import LOST_COHERENCE, MIN_SNR, compare_snapshots, expected_coherence, mean_of
from sounder.quality.spectrum import spectral_lines
from sounder.recordings.recording import Recording
from sounder.remark import Code, Remark


def check_responses(
    cir: xr.Dataset,
    recording: Recording,
    deembedding: Deembedding,
    remarks: Sequence[Remark] = (),
    *,
    trust_all: bool = False,
) -> tuple[xr.Dataset, list[Remark]]:
    """Check the impulse responses of a position against what is known in advance.

    What is certain is put right: snapshots and directions that are shifted, a gain that changes during the scan.
    Directions that contradict the others are left out.

    Parameters
    ----------
    cir : xarray.Dataset
        From :func:`sounder.impulse_responses`.
    recording : Recording
        Its captures are read again where the snapshots of a direction disagree.
    deembedding : Deembedding
        The filter that made ``cir``.
    remarks : sequence of Remark
        Remarks so far.
    trust_all : bool
        Mend and leave out nothing; only say what is wrong.

    Returns
    -------
    cir : xarray.Dataset
        NaN in the directions that are left out. Attribute ``drift_std``: what the removal of a drifting clock leaves in
        the delays [s].
    remarks : list of Remark
        Those so far, and new ones.

    Examples
    --------
    >>> import sounder
    >>> from sounder import shipped
    >>> recordings, b2b = [shipped.calibration("recording-132ghz.h5")], shipped.calibration("back-to-back-132ghz.h5")
    >>> [job], _ = sounder.gather(recordings, calibration=b2b)
    >>> deembedding = sounder.calibrate(job.b2b, job.recording)
    >>> cir, remarks = sounder.impulse_responses(job.recording, deembedding)
    >>> cir, remarks = check_responses(cir, job.recording, deembedding, remarks)
    >>> remarks
    []
    """
    scan = Scan(cir["cir"].values.copy(), cir, recording, deembedding, list(remarks))
    check_gains(scan)
    check_snapshots(scan)
    check_floors(scan)
    check_repetitions(scan)
    check_spectra(scan)
    check_overlaps(scan)
    if trust_all:
        return cir.assign_attrs(drift_std=0.0), scan.remarks
    left_out = scan.left_out
    scan.responses[left_out] = np.nan
    if not np.isfinite(scan.responses).any():
        what = scan.remarks[-1].meaning
        raise DataError(f"{recording.source}: {recording.name}: {what}, in all directions; record the position again")
    checked = cir.copy()
    checked["cir"] = cir["cir"].copy(data=scan.responses)
    return checked.assign_attrs(drift_std=scan.delay_std), scan.remarks


def check_gains(scan: Scan) -> None:
    """Put gains right that have the wrong sign, or that change during the scan."""
    floors = scan.floors()
    if floors.sign < 0:
        spread = float(np.ptp(scan.recording.agc_gain))
        scan.remarks.append(Remark(Code.GAIN_SIGN, figure=2 * spread, bound=floors.bound))
        scan.scale(2 * scan.recording.agc_gain)
    if floors.fall:
        scan.remarks.append(Remark(Code.GAIN_DRIFT, figure=floors.fall, bound=floors.bound))
        scan.scale(-floors.fall * scan.order / max(scan.order.size - 1, 1))


def check_snapshots(scan: Scan) -> None:
    """Compare the snapshots of directions whose mean lost coherence, or is noisier than others."""
    snapshots, averaging = scan.recording.snapshots, scan.averaging
    floors = scan.floors()
    if snapshots < 2 or np.isnan(floors.level):
        return
    noisy = floors.excess.reshape(scan.noise.shape) > floors.bound
    seen = scan.peak > MIN_SNR * 10 ** (floors.level / 10)
    if "coherence" in scan.cir:
        expected = expected_coherence(scan.peak / scan.noise, snapshots)
        allowed = np.maximum(LOST_COHERENCE, np.sqrt(scan.noise / scan.peak))
        lost = scan.cir["coherence"].values < (1 - allowed) * expected
    else:
        lost = np.isfinite(scan.noise)
    for a, e in np.argwhere((lost | noisy) & seen):
        captures = scan.recording.captures(int(a), int(e))
        gain = 10 ** (-scan.recording.agc_gain[a, e] / 20)
        responses = scan.deembedding.apply(scan.correlator.correlate(captures) * gain)
        own = scan.deembedding.self_noise * scan.peak[a, e]  # what the signal brings differs among snapshots
        found = compare_snapshots(responses, snapshots * 10 ** (floors.level / 10) + own)
        if found.shift.any():
            first = int(np.flatnonzero(found.shift)[0])
            scan.remark(Code.SNAPSHOTS_SHIFTED, a, e, snapshot=first, figure=found.shift[first], bound=0.0)
        if not found.good.all() and found.good.any():
            worst = int(np.argmax(found.noise))
            scan.remark(Code.BURST, a, e, snapshot=worst, figure=10 * np.log10(found.noise[worst]))
        if found.shift.any() or not found.good.all():
            scan.replace(a, e, mean_of(responses, found, averaging))


def check_floors(scan: Scan) -> None:
    """Directions whose noise is not what the gain setting says."""
    floors = scan.floors()
    signal = scan.deembedding.self_noise / scan.recording.snapshots * scan.peak / 10 ** (floors.level / 10)
    rise = 10 * np.log10(1 + np.nan_to_num(signal))
    allowed, least = floors.bound + rise, -floors.bound - np.median(rise)  # the common level rises with the median
    excess = floors.excess.reshape(scan.noise.shape)
    for a, e in np.argwhere(excess > allowed):
        dead = scan.peak[a, e] < 10 ** (SIGNAL_TO_PEAK / 10) * scan.noise[a, e]
        scan.remark(Code.DEAD if dead else Code.NOISY, a, e, excess[a, e], allowed[a, e])
    for a, e in np.argwhere(excess < least):
        scan.remark(Code.NOISE_LOW, a, e, excess[a, e], least)


def check_repetitions(scan: Scan) -> None:
    """Directions whose captures repeat an earlier direction's: noise never repeats."""
    known = np.argwhere(np.isfinite(scan.noise) & (scan.noise > 0))
    gain = scan.recording.agc_gain[tuple(known.T)]
    ratio = scan.peak[tuple(known.T)] / scan.noise[tuple(known.T)]
    ranked = np.argsort(ratio, kind="stable")
    for one, other in pairwise(ranked):
        if ratio[other] - ratio[one] > 1e-6 * ratio[one]:
            continue
        raw = [np.abs(scan.responses[tuple(known[k])]) * 10 ** (gain[k] / 20) for k in (one, other)]
        if np.allclose(raw[0], raw[1], rtol=1e-3, atol=1e-3 * raw[0].max()):
            later = max(known[one].tolist(), known[other].tolist(), key=lambda place: scan.order[tuple(place)])
            scan.remark(Code.REPEATED, *later)


def check_spectra(scan: Scan) -> None:
    """Directions with a spectral line that no channel has."""
    known = np.argwhere(np.isfinite(scan.noise) & (scan.noise > 0))
    line, bound = spectral_lines(scan.responses[tuple(known.T)], scan.noise[tuple(known.T)], scan.deembedding)
    for k in np.flatnonzero(line > bound):
        a, e = known[k]
        scan.remark(Code.TONE, a, e, line[k], bound)
