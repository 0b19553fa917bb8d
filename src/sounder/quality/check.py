"""All checks of one position, between its impulse responses and its DAPS."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.stats import norm

from erm.common.errors import DataError
from sounder.cir.deembedding import Deembedding
from sounder.cir.power_spectrum import noise_power
from sounder.cir.responses import Correlator, correlator_of
from sounder.instrument.antenna_pattern import Pattern
from sounder.mpc.clock import scan_order
from sounder.options import Averaging
from sounder.quality.beams import MIN_BEAMS, MISSING, Neighbours, contradictions, find_paths, shift_between
from sounder.quality.beams import MIN_SNR as MIN_PATH_SNR
from sounder.quality.delays import (
    CLOSE,
    DRIFT_FALSE_ALARM,
    LEAST_DRIFT,
    WINDOW,
    Delays,
    clock_drift,
    lost_samples,
    measure_delays,
    slips,
)
from sounder.quality.noise_floor import SIGNAL_TO_PEAK, NoiseFloors, floor_std
from sounder.quality.snapshots import LOST_COHERENCE, MIN_SNR, compare_snapshots, expected_coherence, mean_of
from sounder.quality.spectrum import spectral_lines
from sounder.recordings.recording import Recording
from sounder.remark import Code, Remark

Real = NDArray[np.float64]
Integers = NDArray[np.int64]


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
    position = Position(cir["cir"].values.copy(), cir, recording, deembedding, list(remarks))
    position.check_gains()
    position.check_snapshots()
    position.check_floors()
    position.check_repetitions()
    position.check_spectra()
    position.check_beams()
    if trust_all:
        return cir.assign_attrs(drift_std=0.0), position.remarks
    left_out = position.left_out
    position.responses[left_out] = np.nan
    if not np.isfinite(position.responses).any():
        what = position.remarks[-1].meaning
        raise DataError(f"{recording.source}: {recording.name}: {what}, in all directions; record the position again")
    checked = cir.copy()
    checked["cir"] = cir["cir"].copy(data=position.responses)
    return checked.assign_attrs(drift_std=position.delay_std), position.remarks


@dataclass
class Position:
    """Responses of a position while they are checked and mended.

    Attributes
    ----------
    responses : array complex (azimuth, elevation, sample)
        Mended in place.
    cir : xarray.Dataset
        Responses as they came, with ``coherence`` and ``averaging``.
    recording : Recording
    deembedding : Deembedding
    remarks : list of Remark
    """

    responses: NDArray[np.complex64]
    cir: xr.Dataset
    recording: Recording
    deembedding: Deembedding
    remarks: list[Remark] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.power = np.abs(self.responses) ** 2
        self.noise = noise_power(self.power).astype(float)
        self.peak = self.power.max(axis=-1).astype(float)
        self.delay_std = 0.0

    @property
    def left_out(self) -> NDArray[np.bool_]:
        """Directions (azimuth, elevation) that remarks say are left out."""
        out = np.zeros(self.noise.shape, bool)
        for remark in self.remarks:
            if remark.of_direction and remark.code.value.leaves_out:
                a = int(np.argmin(np.abs(self.recording.azimuth - remark.azimuth)))
                e = int(np.argmin(np.abs(self.recording.elevation - remark.elevation)))
                out[a, e] = True
        return out

    @cached_property
    def order(self) -> Integers:
        """Number of each direction (azimuth, elevation) in the order of the scan."""
        return scan_order(self.recording.time, *self.noise.shape).reshape(self.noise.shape)

    @cached_property
    def correlator(self) -> Correlator:
        """Correlator for single snapshots."""
        return correlator_of(self.recording.kind, self.recording.sounder)

    def replace(self, a: int, e: int, response: NDArray[np.complexfloating]) -> None:
        """Put a mended response in place."""
        self.responses[a, e] = response
        self.power[a, e] = np.abs(response) ** 2
        self.noise[a, e] = noise_power(self.power[a, e])
        self.peak[a, e] = self.power[a, e].max()

    def scale(self, gain: Real) -> None:
        """Change the gain of the directions (azimuth, elevation) [dB]."""
        self.responses *= (10 ** (gain / 20))[..., None].astype(np.float32)
        factor = 10 ** (gain / 10)
        self.power *= factor[..., None].astype(np.float32)
        self.noise *= factor
        self.peak *= factor

    def _place(self, beam: int) -> tuple[int, int]:
        """Indices of azimuth and elevation of a beam."""
        return beam // self.noise.shape[1], beam % self.noise.shape[1]

    def remark(
        self, code: Code, a: int, e: int, figure: float = np.nan, bound: float = np.nan, snapshot: int = -1
    ) -> None:
        """Add a remark about a direction."""
        where = float(self.recording.azimuth[a]), float(self.recording.elevation[e])
        self.remarks.append(Remark(code, *where, snapshot, float(figure), float(bound)))

    def floors(self) -> NoiseFloors:
        """Noise floors against the gain settings."""
        with np.errstate(divide="ignore"):
            floor = 10 * np.log10(self.noise)
        std = floor_std(self.deembedding.noise)
        return NoiseFloors.of(floor.ravel(), self.recording.agc_gain.ravel(), self.order.ravel(), std)

    def check_gains(self) -> None:
        """Put gains right that have the wrong sign, or that change during the scan."""
        floors = self.floors()
        if floors.sign < 0:
            spread = float(np.ptp(self.recording.agc_gain))
            self.remarks.append(Remark(Code.GAIN_SIGN, figure=2 * spread, bound=floors.bound))
            self.scale(2 * self.recording.agc_gain)
        if floors.fall:
            self.remarks.append(Remark(Code.GAIN_DRIFT, figure=floors.fall, bound=floors.bound))
            self.scale(-floors.fall * self.order / max(self.order.size - 1, 1))

    def check_snapshots(self) -> None:
        """Compare the snapshots of directions whose mean lost coherence, or is noisier than others."""
        snapshots, averaging = self.recording.snapshots, self.averaging
        floors = self.floors()
        if snapshots < 2 or np.isnan(floors.level):
            return
        noisy = floors.excess.reshape(self.noise.shape) > floors.bound
        seen = self.peak > MIN_SNR * 10 ** (floors.level / 10)
        if "coherence" in self.cir:
            expected = expected_coherence(self.peak / self.noise, snapshots)
            allowed = np.maximum(LOST_COHERENCE, np.sqrt(self.noise / self.peak))
            lost = self.cir["coherence"].values < (1 - allowed) * expected
        else:
            lost = np.isfinite(self.noise)
        for a, e in np.argwhere((lost | noisy) & seen):
            captures = self.recording.captures(int(a), int(e))
            gain = 10 ** (-self.recording.agc_gain[a, e] / 20)
            responses = self.deembedding.apply(self.correlator.correlate(captures) * gain)
            found = compare_snapshots(responses, snapshots * 10 ** (floors.level / 10))
            if found.shift.any():
                first = int(np.flatnonzero(found.shift)[0])
                self.remark(Code.SNAPSHOTS_SHIFTED, a, e, snapshot=first, figure=found.shift[first], bound=0.0)
            if not found.good.all() and found.good.any():
                worst = int(np.argmax(found.noise))
                self.remark(Code.BURST, a, e, snapshot=worst, figure=10 * np.log10(found.noise[worst]))
            if found.shift.any() or not found.good.all():
                self.replace(a, e, mean_of(responses, found, averaging))

    @property
    def averaging(self) -> Averaging:
        """How snapshots are averaged."""
        averaging: Averaging = self.cir.attrs["averaging"]
        return averaging

    def check_floors(self) -> None:
        """Directions whose noise is not what the gain setting says."""
        floors = self.floors()
        signal = self.deembedding.self_noise / self.recording.snapshots * self.peak / 10 ** (floors.level / 10)
        allowed = floors.bound + 10 * np.log10(1 + np.nan_to_num(signal))
        excess = floors.excess.reshape(self.noise.shape)
        for a, e in np.argwhere(excess > allowed):
            dead = self.peak[a, e] < 10 ** (SIGNAL_TO_PEAK / 10) * self.noise[a, e]
            self.remark(Code.DEAD if dead else Code.NOISY, a, e, excess[a, e], allowed[a, e])
        for a, e in np.argwhere(excess < -floors.bound):
            self.remark(Code.NOISE_LOW, a, e, excess[a, e], -floors.bound)

    def check_repetitions(self) -> None:
        """Directions whose captures repeat an earlier direction's: noise never repeats."""
        known = np.argwhere(np.isfinite(self.noise) & (self.noise > 0))
        gain = self.recording.agc_gain[tuple(known.T)]
        ratio = self.peak[tuple(known.T)] / self.noise[tuple(known.T)]
        ranked = np.argsort(ratio, kind="stable")
        for one, other in pairwise(ranked):
            if ratio[other] - ratio[one] > 1e-6 * ratio[one]:
                continue
            raw = [np.abs(self.responses[tuple(known[k])]) * 10 ** (gain[k] / 20) for k in (one, other)]
            if np.allclose(raw[0], raw[1], rtol=1e-3, atol=1e-3 * raw[0].max()):
                later = max(known[one].tolist(), known[other].tolist(), key=lambda place: self.order[tuple(place)])
                self.remark(Code.REPEATED, *later)

    def check_spectra(self) -> None:
        """Directions with a spectral line that no channel has."""
        known = np.argwhere(np.isfinite(self.noise) & (self.noise > 0))
        line, bound = spectral_lines(self.responses[tuple(known.T)], self.deembedding)
        for k in np.flatnonzero(line > bound):
            a, e = known[k]
            self.remark(Code.TONE, a, e, line[k], bound)

    @property
    def snr(self) -> NDArray[np.float32]:
        """Power over the noise (beam, delay) of the directions that are used; 0 in others."""
        used = np.isfinite(self.noise) & (self.noise > 0) & ~self.left_out
        snr = self.power / np.where(used, self.noise, np.inf)[..., None].astype(np.float32)
        return np.nan_to_num(snr.reshape(used.size, -1))

    def check_beams(self) -> None:
        """Compare beams that overlap: delays, and powers against the antenna pattern."""
        antenna = self.recording.sounder.rx_antenna
        if not Pattern.of(antenna).directive or self.noise.size < MIN_BEAMS:
            return
        near = Neighbours.of(self.recording.azimuth, self.recording.elevation, antenna)
        snr = self.snr
        paths = find_paths(snr, near)
        if self._mend_lost_samples(measure_delays(snr, paths, WINDOW, strict=False)):
            snr = self.snr
            paths = find_paths(snr, near)
        if self._mend_drift(measure_delays(snr, paths, CLOSE, strict=True)):
            snr = self.snr
            paths = find_paths(snr, near)
        if self._mend_slips(measure_delays(snr, paths, CLOSE, strict=True)):
            snr = self.snr
            paths = find_paths(snr, near)
        against = contradictions(paths, snr)
        if against.any():
            self._mend_shifts(snr, near, against)

    def _roll(self, beam: int, shift: int) -> None:
        a, e = self._place(beam)
        self.responses[a, e] = np.roll(self.responses[a, e], -shift)
        self.power[a, e] = np.roll(self.power[a, e], -shift)

    def _mend_lost_samples(self, delays: Delays) -> bool:
        """Shift back the directions after samples were lost."""
        order = self.order.ravel()
        first, shift = lost_samples(delays, order)
        if not shift:
            return False
        for beam in np.flatnonzero(order >= first):
            self._roll(int(beam), shift)
        a, e = self._place(int(np.flatnonzero(order == first)[0]))
        self.remark(Code.SAMPLES_LOST, a, e, shift, 0.0)
        return True

    def _mend_slips(self, delays: Delays) -> bool:
        """Shift back single directions that slipped by a whole number of samples."""
        shifts = slips(delays, self.noise.size)
        for beam in np.flatnonzero(shifts):
            self._roll(int(beam), int(shifts[beam]))
            self.remark(Code.SLIPPED, *self._place(int(beam)), shifts[beam], 0.0)
        return bool(shifts.any())

    def _mend_shifts(self, snr: NDArray[np.float32], near: Neighbours, against: Real) -> None:
        """Shift back directions that contradict the others, where a shift reconciles them; leave out the rest."""
        trusted = np.where(against[:, None] > 0, 0, snr)
        shifts = {}
        for beam in np.flatnonzero(against):
            around = near.beam[beam][near.beam[beam] >= 0]
            others = trusted[around].max(axis=0)
            if not np.any(others > MIN_PATH_SNR):
                others = trusted.max(axis=0)
            shift = shift_between(snr[beam], others)
            if shift:
                shifts[int(beam)] = shift
                trusted[beam] = np.roll(snr[beam], -shift)
        still = contradictions(find_paths(trusted, near), trusted)
        for beam in np.flatnonzero(against):
            place = self._place(int(beam))
            if beam in shifts and not still[beam]:
                self._roll(int(beam), shifts[int(beam)])
                self.remark(Code.SLIPPED, *place, shifts[int(beam)], 0.0)
            else:
                self.remark(Code.INCONSISTENT, *place, against[beam], MISSING)

    def _mend_drift(self, delays: Delays) -> bool:
        """Remove the drift of the clock over the scan. The clock is right at the first direction."""
        order = self.order
        drift, bound = clock_drift(delays, order.ravel())
        total = drift * order.size
        sample = 1 / self.deembedding.sample_rate
        walk = 3 * self.recording.sounder.clock.step / sample * np.sqrt(order.size)
        if abs(total) < max(LEAST_DRIFT, walk, bound * order.size):
            return False
        frequency = np.fft.fftfreq(self.responses.shape[-1])
        ramp = np.exp(2j * np.pi * np.multiply.outer(drift * order, frequency))
        self.responses[...] = np.fft.ifft(np.fft.fft(self.responses) * ramp)
        self.power[...] = np.abs(self.responses) ** 2
        self.delay_std = bound / float(norm.isf(DRIFT_FALSE_ALARM)) * order.size * sample
        figures = total * sample * 1e9, bound * order.size * sample * 1e9
        self.remarks.append(Remark(Code.CLOCK_DRIFT, figure=figures[0], bound=figures[1]))
        return True
