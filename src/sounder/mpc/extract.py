"""Multipath components (MPCs): delay, angle of arrival and path gain of the paths in a CIR, with their errors."""

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from sounder.cir.deembedding import Deembedding
from sounder.cir.matched_filter import OVERSAMPLING, MatchedFilter
from sounder.cir.power_spectrum import noise_power
from sounder.instrument.antenna_pattern import Pattern
from sounder.instrument.description import Sounder
from sounder.kernels.extraction import columns
from sounder.kernels.extraction.peak_search import Limits, search_of
from sounder.kernels.extraction.sage import PASSES, TAKES, cancel
from sounder.kernels.extraction.scan_view import View, beams_of, table_of
from sounder.mpc.clock import clock_variance, scan_order
from sounder.mpc.cramer_rao import Band
from sounder.mpc.elevation_gain import with_ridge
from sounder.mpc.joint import Scan, refine
from sounder.mpc.overlap import widening
from sounder.mpc.single_thread import one_thread
from sounder.mpc.table import tabulate
from sounder.mpc.two_paths import split
from sounder.mpc.uncertainty import beams_seeing, widened
from sounder.options import Method, Threshold

EFFORT: dict[Method, tuple[int, int, int]] = {"sage": (1, 3, 2), "clean": (1, 0, 0), "peaks": (0, 0, 0)}
"""Whether paths are taken out, how often those about a new one are fitted again, and how often all are in the end."""

CAPACITY = 1024
"""Most MPCs a position can have."""
MARGIN = 2.0
"""Amplitude over the pattern's prediction that still counts as the same path (6 dB, for horns not as measured)."""
LEFTOVER = 0.1
"""Amplitude, relative to a path in its beam, under which what a fit leaves around it is its own remainder (-20 dB)."""
DYNAMIC_RANGE = 75.0
"""How far under the strongest sample a path can be told from what cancellation leaves of others [dB]."""
LOCATED = 3.0
"""How far over the pattern's sidelobes a path must stand in its beam for its angle to be believed [dB]."""


@one_thread()
def extract(
    cir: xr.Dataset,
    filter_: Deembedding,
    sounder: Sounder,
    *,
    distance: float = 0.0,
    threshold: Threshold = "usc",
    method: Method = "sage",
    time: NDArray[np.float64] | None = None,
) -> xr.Dataset:
    """Extract the MPCs of a position.

    The strongest sample of all beams is refined to a path: its delay, and its magnitudes in the beam and the eight
    around it, by the matched filter of the calibrated pulse; its angles and amplitude by fitting the antenna's
    pattern to these magnitudes. Then the path is taken out of every beam, sidelobes in delay and angle with it, and
    the search starts again, until nothing exceeds the threshold. Paths that share samples are fitted again in turn.
    Where one path does not explain the beams at its delay, but two do, there are two (:mod:`sounder.mpc.two_paths`).
    Paths whose pulses overlap are fitted once more, together, if one phase of each explains all beams
    (:mod:`sounder.mpc.joint`). For the errors see :func:`sounder.mpc.table.tabulate`; those of one path alone are up
    to 1.16 times the Cramer-Rao bound.

    Parameters
    ----------
    cir : xarray.Dataset
        ``cir`` (azimuth, elevation, delay), from :func:`sounder.cir.impulse_response.impulse_responses`.
    filter_ : Deembedding
        That made it; its pulse is the shape of a single path.
    sounder : Sounder
        For the receive antenna's pattern, the period and the clock.
    distance : float
        Direct distance from TX to RX [m]. Delays are known modulo the sequence's period; no path is shorter than the
        direct one, so earlier ones are late by a period.
    threshold : {"usc", "nyu"}
        ``usc``: noise floor + 12 dB, which noise alone exceeds once in 7 million samples (Gomez-Ponce et al.).
        ``nyu``: the higher of strongest - 25 dB and noise floor + 5 dB (Sun et al.); noise alone exceeds the second
        in 4 % of the samples, so that weak positions fill with noise.
    method : {"sage", "clean", "peaks"}
        ``sage``: as above; overlapping paths are fitted in turn, each to what the others leave (Fleury et al., 1999).
        ``clean``: each path is fitted once, when it is taken out (Hogbom, 1974). ``peaks``: nothing is taken out;
        peaks that stand 6 dB over what stronger ones and the antenna's sidelobes explain are fitted as they are.
    time : array (azimuth, elevation), optional
        When each direction was recorded, in any unit: the order in which the clock wanders. If it is not known, all
        azimuths at each elevation in turn.

    Returns
    -------
    xarray.Dataset
        Along ``mpc``, strongest first, possibly none; the columns of :func:`sounder.mpc.table.tabulate` and
        :func:`sounder.mpc.elevation_gain.with_ridge`. The attribute ``paths_outside_fan`` counts the paths left out
        because only sidelobes saw them, so that their angle is not known; ``complete`` is 0 if more paths exceed the
        threshold than a table holds; ``period`` [s] is that of the sequence, by whole numbers of which delays may be
        too short.
    """
    azimuth, elevation = cir["azimuth"].values, cir["elevation"].values
    beams = np.array(cir["cir"].values.reshape(azimuth.size * elevation.size, -1), np.complex64, order="C")
    noise = noise_power(np.abs(beams) ** 2).astype(float)
    matched = filter_.matched_filter
    pattern = Pattern.of(sounder.rx_antenna)
    widths = sounder.rx_antenna.hpbw_azimuth or 360.0, sounder.rx_antenna.hpbw_elevation or 180.0
    effort = np.array(EFFORT[method])
    view = _view(azimuth, elevation, noise, pattern, matched, *widths)
    bandwidth = np.ptp(np.fft.fftfreq(filter_.weight.size, 1 / filter_.sample_rate)[filter_.weight > 0])
    limits = Limits(
        threshold=_thresholds(beams, noise, threshold),
        resolution=np.array([filter_.sample_rate / bandwidth, widths[0] / 2, widths[1]]),
        leftover=_leftover(pattern, takes=bool(effort[TAKES])),
        artefact=np.array(
            [[copy.delay * filter_.sample_rate, 10 ** (copy.level / 20)] for copy in sounder.processing.artefact]
        ).reshape(-1, 2),
        margin=MARGIN,
    )
    work = columns.work_of(view)
    found = np.zeros((CAPACITY, columns.COLUMNS))
    taken = np.zeros((CAPACITY, len(beams)), np.complex64)
    count, complete = cancel(beams, view, limits, effort, work, search_of(beams, work), found, taken)
    found, taken, pair = found[:count], taken[:count], np.full(count, -1)
    if effort[PASSES] and azimuth.size > 2 and elevation.size > 1 and pattern.directive:
        whole, looks = cir["cir"].values.reshape(beams.shape), _looks(azimuth, elevation)
        found, taken, pair = split(found, taken, whole, noise, looks, widths, pattern, filter_, limits.threshold)
        scan = Scan(whole, noise, looks, widths, pattern, filter_, limits.threshold)
        found, pair = refine(found, taken, pair, scan)
    order = np.argsort(-found[:, columns.AMPLITUDE])
    found, pair = found[order], pair[order]
    located = _located(found, pattern, widths[0])
    axes = azimuth.astype(float), elevation.astype(float)
    wider, clock = _besides_noise(found, pair, beams if effort[TAKES] else None, noise, axes, filter_, sounder, time)
    fans = elevation.size > 1
    found, wider, clock = found[located], wider[located], clock[located]
    table = tabulate(found, noise, filter_, sounder, distance, wider=wider, clock=clock, fans=fans)
    table = with_ridge(table, axes, pattern)
    period = filter_.weight.size / filter_.sample_rate
    facts = {"threshold": threshold, "method": method, "complete": int(complete), "period": period}
    return table.assign_attrs(facts, paths_outside_fan=int((~located).sum()))


def _besides_noise(
    found: NDArray[np.float64],
    pair: NDArray[np.int64],
    left: NDArray[np.complex64] | None,
    noise: NDArray[np.float64],
    axes: tuple[NDArray[np.float64], NDArray[np.float64]],
    filter_: Deembedding,
    sounder: Sounder,
    time: NDArray[np.float64] | None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """What other paths and the clock add: `sounder.mpc.uncertainty.widened`, `sounder.mpc.clock.clock_variance`."""
    snr = (MARGIN * found[:, columns.AMPLITUDE]) ** 2 / noise[found[:, columns.BEAM].astype(int)]
    seen = beams_seeing(found, noise, axes, Pattern.of(sounder.rx_antenna))
    wider = widening(found, snr, seen, Band.of(filter_), filter_.sample_rate, pair)
    turns = scan_order(time, axes[0].size, axes[1].size)
    return (
        widened(wider, found, left, noise, seen, filter_),
        clock_variance(seen.beam, seen.weight, turns, sounder.clock.step),
    )


def _looks(azimuth: NDArray[np.float64], elevation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Azimuth and elevation (beam, 2) of all beams, azimuth-major [degree]."""
    return np.stack([grid.ravel() for grid in np.meshgrid(azimuth, elevation, indexing="ij")], axis=-1).astype(float)


def _view(
    azimuth: NDArray[np.float64],
    elevation: NDArray[np.float64],
    noise: NDArray[np.float64],
    pattern: Pattern,
    matched: MatchedFilter,
    width_azimuth: float,
    width_elevation: float,
) -> View:
    looks = _looks(azimuth, elevation)
    step_azimuth = float(np.diff(azimuth).max()) if azimuth.size > 1 else 0.0
    around = azimuth.size > 1 and azimuth[0] + 360 - azimuth[-1] <= 1.5 * step_azimuth
    return View(
        beam=beams_of(noise, looks),
        azimuth_cut=table_of(pattern.azimuth_cut),
        elevation_cut=table_of(pattern.elevation_cut),
        pulse=matched.pulse,
        matched=matched.taps,
        limits=np.array(
            [
                max(step_azimuth, width_azimuth / 2),
                elevation.min() - 2 * width_elevation,
                elevation.max() + 2 * width_elevation,
                width_elevation,
                pattern.floor * np.log(10) / 20,
                matched.amplitude_variance,
            ]
        ),
        grid=np.array([azimuth.size, elevation.size, int(around), OVERSAMPLING]),
    )


def _leftover(pattern: Pattern, *, takes: bool) -> NDArray[np.float64]:
    """Shares of a path that count as its own remainder, see `Limits.leftover`; of a path left in, all the beams see."""
    if not takes:
        return np.array([MARGIN, 0.0, 0.0])
    return np.array([LEFTOVER, MARGIN, 10 ** (pattern.sidelobe_level / 20) if pattern.directive else 0.0])


def _lobe(pattern: Pattern) -> float:
    """Amplitude of the pattern that tells directions apart: over all sidelobes, or well over what all beams see."""
    level = min(pattern.sidelobe_level, pattern.floor + 20 * np.log10(MARGIN)) + LOCATED
    return float(10 ** (level / 20)) if pattern.directive else 0.0


def _located(found: NDArray[np.float64], pattern: Pattern, width: float) -> NDArray[np.bool_]:
    """Tell the paths whose direction the main lobe has seen.

    A path far above or below the fan is seen through the sidelobes, alike by all beams; its delay is right, its angle
    is not known. Nor is that of what the pattern does not fit.
    """
    seen = found[:, columns.OFF_BORESIGHT] > _lobe(pattern)
    located: NDArray[np.bool_] = seen & ~(found[:, columns.VAR_AZIMUTH] > (width / 2) ** 2)
    return located


def _thresholds(beams: NDArray[np.complex64], noise: NDArray[np.float64], threshold: Threshold) -> NDArray[np.float64]:
    """Least power of a path in every beam; infinite where nothing was recorded."""
    strongest = float(np.max(np.abs(beams), where=np.isfinite(beams), initial=0.0)) ** 2
    if threshold == "usc":
        level = np.maximum(strongest * 10 ** (-DYNAMIC_RANGE / 10), noise * 10**1.2)
    else:
        level = np.maximum(strongest * 10**-2.5, noise * 10**0.5)
    return np.where(np.isfinite(noise), level, np.inf)
