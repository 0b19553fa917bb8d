"""Cramer-Rao bounds: the least errors of delay, angles and gain of paths that any unbiased estimator can reach.

In direction ``b`` the receiver measures the spectrum, at the frequencies ``f_k`` of the band,

``Y_bk = sum_p A_p g_b(w_p) exp(j phi_pb) s_k exp(-2j pi f_k tau_p) + n_bk``.

``A_p`` is the amplitude of path ``p``, ``g_b`` the pattern of the horn when it looks at ``b``, ``w_p`` the path's
azimuth and elevation, ``s_k`` the sent spectrum, and ``n_bk`` white circular noise, here of variance 1. The phases
``phi_pb`` are unknown: the phase centre moves as the horn turns, and cables and oscillators drift. So neighbouring
directions hold information about the angles in their magnitudes alone.

With ``mu`` the mean of the data, the Fisher information about parameters ``x`` is
``F = 2 Re sum_bk (d mu_bk / d x)^H (d mu_bk / d x)``. The phases are nuisance parameters. They are eliminated by the
Schur complement: with ``F`` in blocks of wanted and unwanted, ``F_e = F_ww - F_wu F_uu^-1 F_uw``. No unbiased estimator
has a smaller covariance than ``F_e^-1``.

For one path, and ``d_k = |s_k|^2`` with sum ``D``, mean frequency ``f`` and RMS bandwidth ``B``, that is

``var(tau) >= 1 / (2 A^2 D (2 pi B)^2 sum_b g_b^2)``,
``cov(az, el, ln A) >= [2 A^2 D sum_b (g_az, g_el, g)_b (g_az, g_el, g)_b^T]^-1``

where ``g_az`` is the derivative of ``g`` by azimuth. Delay and angles are independent.

The pattern is taken as known, with its sidelobes and its floor. Far above the fan, where only these see a path, the
bound holds for a horn that is known better than most are.

References
----------
Kay, Fundamentals of Statistical Signal Processing: Estimation Theory, 1993, sections 3.7 to 3.11 and 15.7. Scharf,
Statistical Signal Processing, 1991, section 6.5 (nuisance parameters).
"""

from dataclasses import dataclass
from typing import Literal, Self

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from sounder.cir.deembedding import Deembedding
from sounder.instrument.antenna_pattern import ANGLE_STEP, Pattern
from sounder.mpc.directions import DB_PER_NEPER, beam_directions, beam_gains

Phases = Literal["own", "shared"]
Real = NDArray[np.float64]

UNITS = {"delay": "s", "azimuth": "degree", "elevation": "degree", "path_gain": "dB"}
"""Parameters of an MPC and their units."""
SINGULAR = 1e-9
"""Information that counts as rounding, relative to what there would be if all other parameters were known."""


@dataclass(frozen=True)
class Band:
    """Information that a direction holds about a path, by frequency.

    The SNR of a path is that of its peak in the impulse response: its power over the noise's. With ``V_k`` the spectrum
    of the pulse and ``N_k`` the power spectrum of the noise in the impulse response, a path of SNR ``snr`` has
    ``snr d_k`` at frequency ``k``, ``d_k = V_k^2 / N_k sum(N) / sum(V)^2``. The sum of ``d_k`` is 1 for the matched
    filter, and more for any other (Cauchy and Schwarz): a window that lowers the sidelobes lowers the SNR of the peak,
    but not the information in the data.

    Attributes
    ----------
    frequency : array (sample,)
        From the carrier [Hz].
    density : array (sample,)
        ``d_k``.
    """

    frequency: Real
    density: Real

    @classmethod
    def of(cls, filter_: Deembedding) -> Self:
        """Band of impulse responses made with a de-embedding filter from white receiver noise."""
        frequency = np.fft.fftfreq(filter_.weight.size, 1 / filter_.sample_rate).astype(float)
        noise = filter_.noise
        # DC is not measured and holds no information
        density = np.divide(filter_.weight**2, noise, out=np.zeros_like(noise), where=noise > 0)
        return cls(frequency, density * noise.sum() / filter_.weight.sum() ** 2)

    @classmethod
    def rectangular(cls, width: float, samples: int = 1001) -> Self:
        """Flat spectrum of a full ``width`` [Hz] through its matched filter, at the middles of equal parts."""
        return cls(width * ((np.arange(samples) + 0.5) / samples - 0.5), np.full(samples, 1 / samples))

    @classmethod
    def held_chip(cls, chip_rate: float, width: float | None = None, samples: int = 1001) -> Self:
        """Spectrum ``sinc(f / chip_rate)`` of held chips through its matched filter; by default its main lobe."""
        flat = cls.rectangular(width or 2 * chip_rate, samples)
        density = np.sinc(flat.frequency / chip_rate) ** 2
        return cls(flat.frequency, density / density.sum())

    @property
    def rms(self) -> float:
        """RMS bandwidth about the mean frequency [Hz]."""
        mean = np.average(self.frequency, weights=self.density)
        return float(np.sqrt(np.average((self.frequency - mean) ** 2, weights=self.density)))

    @property
    def window_loss(self) -> float:
        """How much lower the SNR of the peak is than that of the matched filter [dB]."""
        return float(10 * np.log10(self.density.sum()))


def cramer_rao(
    paths: xr.Dataset,
    azimuth: ArrayLike,
    elevation: ArrayLike,
    pattern: Pattern,
    band: Band,
    *,
    phases: Phases = "own",
    drift: float = 0.0,
) -> xr.Dataset:
    """Cramer-Rao bounds of the paths of a position, all of them unknown at once.

    Parameters
    ----------
    paths : xarray.Dataset
        One dimension, of length 1 or more: ``delay`` [s], ``azimuth``, ``elevation`` [degree], ``snr`` [dB] of the peak
        in the direction that sees the path best. The bounds of paths that overlap depend on the phases between them:
        ``phase`` [radian], along that dimension and ``direction`` (azimuth-major); zero if absent.
    azimuth, elevation : array (azimuth,), (elevation,)
        Directions of the scan [degree]. If an axis has one direction, that angle is taken as known, and its bound is
        NaN.
    pattern : Pattern
        Of the receive antenna.
    band : Band
        Information about a path by frequency.
    phases : {"own", "shared"}
        ``own``: an unknown phase for every path in every direction, as the phase centre turns with the horn.
        ``shared``: one unknown phase for every direction and one for every path, if only cables and oscillators
        drift.
    drift : float
        Standard deviation of the steps of the clock's random walk from one direction to the next [s], in the order of
        the scan (azimuths first), 0 at the first direction. Its prior is information (a hybrid bound).

    Returns
    -------
    xarray.Dataset
        ``delay_std`` [s], ``azimuth_std``, ``elevation_std`` [degree], ``path_gain_std`` [dB] along the dimension of
        the paths; infinite where the scan holds no information. Two paths of one delay are such a case with ``own``
        phases: a direction has one complex number for them, and two unknown phases. (The bound leaves out that phases
        are random: over many directions the magnitudes hold a little information even then.)

    Examples
    --------
    The bounds of a path of 30 dB SNR in a scan of a horn of 10 degree beamwidth:

    >>> from sounder import load_sounder, shipped
    >>> sounder = load_sounder(shipped.calibration("sounder-132ghz.toml"))
    >>> path = xr.Dataset({"delay": ("path", [1e-7]), "azimuth": ("path", [42.0]), "elevation": ("path", [1.0])})
    >>> band = Band.held_chip(sounder.waveform.chip_rate)
    >>> bound = cramer_rao(
    ...     path.assign(snr=("path", [30.0])), range(0, 360, 10), [-9, 0, 9], Pattern.of(sounder.rx_antenna), band
    ... )
    >>> print(f"{bound['delay_std'][0] * 1e12:.1f} ps, {bound['azimuth_std'][0]:.2f} degree")
    15.5 ps, 0.17 degree
    """
    (dim,) = paths["delay"].dims
    count = paths.sizes[dim]
    scan = np.asarray(azimuth, float), np.asarray(elevation, float)
    slopes = _slopes(paths["azimuth"].values, paths["elevation"].values, beam_directions(*scan), pattern)
    amplitude = 10 ** (paths["snr"].values / 20) / slopes[-1].max(axis=-1)
    phase = np.zeros(slopes[-1].shape) if "phase" not in paths else paths["phase"].transpose(dim, "direction").values
    weight = amplitude[:, None] * np.exp(1j * phase) * slopes  # (derivative, path, direction)

    # Columns of d mu: by delay -2j pi f times the path, by angles and gain the slopes, by phase j times the path.
    columns = np.stack([-2j * np.pi * weight[2], weight[0], weight[1], weight[2] / DB_PER_NEPER, 1j * weight[2]])
    power = np.array([1, 0, 0, 0, 0])  # of the frequency in them
    late = paths["delay"].values[None, :] - paths["delay"].values[:, None]
    shift = np.exp(-2j * np.pi * late[..., None] * band.frequency) * band.density
    moment = np.stack([shift @ band.frequency**m for m in range(3)])[power[:, None] + power]  # (i, j, path, path)
    information = 2 * np.einsum("ipb,ijpq,jqb->bipjq", columns.conj(), moment, columns).real
    information = information.reshape(-1, 5 * count, 5 * count)

    wanted = [i for i, known in enumerate([False, scan[0].size == 1, scan[1].size == 1, False]) if not known]
    kept = [i * count + p for i in wanted for p in range(count)]
    walk = _walk(scan[0].size, scan[1].size, drift)
    remaining = _without_phases(information, kept, count, phases, walk)
    std = np.full((4, count), np.nan)
    std[wanted] = np.sqrt(_variances(remaining)[: len(kept)]).reshape(len(wanted), count)
    return xr.Dataset(
        {
            f"{name}_std": (dim, std[i], {"units": unit, "long_name": f"Cramer-Rao bound of {name.replace('_', ' ')}"})
            for i, (name, unit) in enumerate(UNITS.items())
        }
    )


def _slopes(azimuth: Real, elevation: Real, directions: Real, pattern: Pattern) -> Real:
    """Derivatives by azimuth and elevation [1/degree] of the amplitude pattern, and itself; (3, path, direction).

    The cuts are linear in dB between angles ``ANGLE_STEP`` apart. Differences over that step are those of the measured
    curve.
    """

    def level(east: float, up: float) -> Real:
        return beam_gains(azimuth + east, elevation + up, directions, pattern)

    g = 10 ** (level(0, 0) / 20)
    by_azimuth = (level(ANGLE_STEP, 0) - level(-ANGLE_STEP, 0)) / (2 * ANGLE_STEP * DB_PER_NEPER)
    by_elevation = (level(0, ANGLE_STEP) - level(0, -ANGLE_STEP)) / (2 * ANGLE_STEP * DB_PER_NEPER)
    return np.stack([by_azimuth * g, by_elevation * g, g])


def _walk(azimuths: int, elevations: int, step: float) -> Real:
    """Covariance (direction, direction) [s2] of a random walk in the order of the scan; directions azimuth-major."""
    order = np.arange(azimuths * elevations).reshape(elevations, azimuths).T.ravel()
    walk: Real = step**2 * np.minimum.outer(order, order).astype(float)
    return walk


def _without_phases(information: Real, kept: list[int], count: int, phases: Phases, walk: Real) -> Real:
    """Information about the parameters ``kept``, followed with shared phases by that about those between paths.

    What shifts all delays of a direction, of covariance ``C``, takes ``W (C^-1 + diag(d))^-1 W^T``: with ``u`` 1 for
    every delay, the columns of ``W`` are ``F_b u`` and ``d_b = u^T F_b u``.
    """
    own = [4 * count + p for p in range(count)]
    if phases == "own":
        wanted, unwanted = np.eye(5 * count)[kept], np.eye(5 * count)[own]
    else:
        wanted = np.eye(5 * count)[kept + own[1:]]
        unwanted = np.eye(5 * count)[own].sum(axis=0, keepdims=True)
    across = wanted @ information @ unwanted.T
    inverse = np.linalg.pinv(unwanted @ information @ unwanted.T, hermitian=True, rcond=1e-12)
    remaining = wanted @ information @ wanted.T - across @ inverse @ across.transpose(0, 2, 1)
    # Relative to what there would be if the phases were known, so that rounding is not taken for information.
    known = np.sqrt(np.einsum("bii->i", wanted @ information @ wanted.T))
    scale = np.where(known > 0, known, 1)
    delays = (np.arange(len(wanted)) < count).astype(float)  # they come first
    shifted = remaining @ delays
    lost = shifted.T @ walk @ np.linalg.solve(np.eye(len(walk)) + (shifted @ delays)[:, None] * walk, shifted)
    return np.stack([(remaining.sum(axis=0) - lost) / np.outer(scale, scale), np.diag(1 / scale)])


def _variances(information: Real) -> Real:
    """Diagonal of the inverse of scaled information (first) and scale (second); infinite where it is singular."""
    scaled, scale = information
    value, vector = np.linalg.eigh(scaled)
    regular = value > SINGULAR
    variance = (vector[:, regular] ** 2 / value[regular]).sum(axis=1) * np.diag(scale) ** 2
    undetermined = (vector[:, ~regular] ** 2).sum(axis=1) > SINGULAR
    return np.where(undetermined, np.inf, variance)
