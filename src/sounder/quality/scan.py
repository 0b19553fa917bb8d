"""The directions of a position while they are checked: responses, powers, noise, remarks."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from sounder.cir.deembedding import Deembedding
from sounder.cir.power_spectrum import noise_power
from sounder.cir.responses import Correlator, correlator_of
from sounder.mpc.clock import scan_order
from sounder.options import Averaging
from sounder.quality.noise_floor import NoiseFloors, floor_std
from sounder.recordings.recording import Recording
from sounder.remark import Code, Remark

Real = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass
class Scan:
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

    def place(self, beam: int) -> tuple[int, int]:
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

    @property
    def averaging(self) -> Averaging:
        """How snapshots are averaged."""
        averaging: Averaging = self.cir.attrs["averaging"]
        return averaging

    @property
    def snr(self) -> NDArray[np.float32]:
        """Power over the noise (beam, delay) of the directions that are used; 0 in others."""
        used = np.isfinite(self.noise) & (self.noise > 0) & ~self.left_out
        snr = self.power / np.where(used, self.noise, np.inf)[..., None].astype(np.float32)
        return np.nan_to_num(snr.reshape(used.size, -1))

    def roll(self, beam: int, shift: int) -> None:
        """Remove a delay of a beam [sample]."""
        a, e = self.place(beam)
        self.responses[a, e] = np.roll(self.responses[a, e], -shift)
        self.power[a, e] = np.roll(self.power[a, e], -shift)
