"""Multipath components (MPCs): delay, angle of arrival and path gain of the paths in a CIR, with their errors."""

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from sounder.cir.deembedding import Deembedding
from sounder.instrument.description import Sounder
from sounder.kernels.extraction.peak_search import new_search
from sounder.kernels.extraction.records import PATH
from sounder.kernels.extraction.sage import Effort, cancel
from sounder.kernels.extraction.workspace import workspace
from sounder.mpc.clock import clock_variance, scan_order
from sounder.mpc.elevation_gain import with_elevation_gain
from sounder.mpc.joint import refine_jointly
from sounder.mpc.scan import Scan
from sounder.mpc.single_thread import single_thread
from sounder.mpc.stated import pattern_covariance
from sounder.mpc.table import tabulate
from sounder.mpc.threshold import independent_samples
from sounder.mpc.two_paths import split_paths
from sounder.mpc.uncertainty import beam_power, best_beams, variance_inflation
from sounder.options import Method, Threshold, require_choice

EFFORT: dict[Method, Effort] = {"sage": Effort(1, 3, 2), "clean": Effort(1, 0, 0), "peaks": Effort(0, 0, 0)}

CAPACITY = 1024
"""Most MPCs of a position."""
LOCATED = 3.0
"""How far above the pattern's sidelobes a path must be in its beam for its angle to be known [dB]; chosen."""


@single_thread()
def extract_mpcs(
    cir: xr.Dataset,
    filter_: Deembedding,
    sounder: Sounder,
    *,
    distance: float = 0.0,
    threshold: str | Threshold = "cfar",
    method: Method = "sage",
    time: NDArray[np.float64] | None = None,
) -> xr.Dataset:
    """Extract the MPCs of a position.

    The search starts at the strongest sample of all beams. The matched filter of the calibrated pulse gives the delay
    of this path, and its magnitudes in the beam and in the eight beams around it. The antenna pattern is fitted to
    these magnitudes and gives the angles and the amplitude. Then the path is subtracted from every beam, with its
    sidelobes in delay and angle. The search is repeated until nothing exceeds the threshold. Paths that share samples
    are fitted again, one after another. If two paths explain the beams at a delay, but one path does not, it becomes
    two paths (:mod:`sounder.mpc.two_paths`).
    Paths whose pulses overlap are fitted once more, together, if one phase per path explains all beams
    (:mod:`sounder.mpc.joint`). For the errors see :func:`sounder.mpc.table.tabulate`; those of one path alone are up
    to 1.16 times the Cramer-Rao bound.

    Parameters
    ----------
    cir : xarray.Dataset
        ``cir`` (azimuth, elevation, delay), from :func:`sounder.cir.impulse_response.impulse_responses`.
    filter_ : Deembedding
        The filter that made ``cir``. Its pulse is the shape of a single path.
    sounder : Sounder
        Description of the receive antenna, the clock, and the copies that the instrument makes of paths.
    distance : float
        Direct distance from TX to RX [m]. Delays are known modulo the period of the sequence. No path is shorter than
        the direct one, so that earlier delays are too short by a period.
    threshold : str or Threshold
        What counts as a path; see :class:`sounder.options.Threshold`. ``cfar``: what noise alone exceeds in 1 of 20
        positions, at any length of the sequence and number of beams; ``cfar:0.01``: in 1 of 100. ``usc``: noise floor
        + 12 dB, which noise alone exceeds once in 7 million samples (Gomez-Ponce et al.). ``nyu``: the higher of
        strongest - 25 dB and noise floor + 5 dB (Sun et al.). Noise alone exceeds the second in 4 % of the samples, so
        that positions with weak paths fill with noise. Or numbers: dB over the noise floor, dynamic range [dB], delay
        gate [s], as in ``10,30,4e-7``. Paths later than the gate are subtracted from the beams, but not listed.
    method : {"sage", "clean", "peaks"}
        ``sage``: as above; overlapping paths are fitted in turn, each to the residual of the others (Fleury et al.,
        1999). ``clean``: each path is fitted once, before it is subtracted (Hogbom, 1974). ``peaks``: nothing is
        subtracted; peaks 6 dB above the sidelobes of stronger paths are fitted as they are.
    time : array (azimuth, elevation), optional
        When each direction was recorded, in any unit. It gives the order in which the clock drifts. Default: all
        azimuths at each elevation in turn.

    Returns
    -------
    xarray.Dataset
        Along ``mpc``, strongest first, possibly of length 0: the columns of :func:`sounder.mpc.table.tabulate` and
        :func:`sounder.mpc.elevation_gain.with_elevation_gain`. Attributes: ``paths_outside_fan``, the number of paths
        left out because only sidelobes see them, so that their angles are not known; ``paths_beyond_gate``, the number
        left out because they are later than the delay gate; ``complete``, 0 if more paths
        exceed the threshold than a table holds; ``period`` of the sequence [s], by whole numbers of which delays may
        be too short; ``samples`` of the scan, and ``independent_samples`` of noise in a beam.

    Examples
    --------
    A direct path at 101.6 ns and a reflection:

    >>> import sounder
    >>> from sounder import shipped
    >>> recordings, b2b = [shipped.calibration("recording-132ghz.h5")], shipped.calibration("back-to-back-132ghz.h5")
    >>> [job], _ = sounder.gather(recordings, calibration=b2b)
    >>> deembedding = sounder.calibrate(job.b2b, job.recording)
    >>> cir, remarks = sounder.impulse_responses(job.recording, deembedding)
    >>> mpcs = sounder.extract_mpcs(cir, deembedding, job.recording.sounder)
    >>> [f"{delay * 1e9:.1f} ns" for delay in mpcs["delay"].values]
    ['101.6 ns', '139.3 ns']
    """
    threshold = Threshold.of(threshold)
    require_choice("method", method, Method)
    scan = Scan.of(cir, filter_, sounder, threshold)
    effort = EFFORT[method]
    residual = scan.cir.copy()
    found, removed, complete = _cancel(residual, scan, effort)
    group = np.full(len(found), -1)
    if effort.passes and scan.azimuth.size > 2 and scan.elevation.size > 1 and scan.pattern.directive:
        found, removed, group = split_paths(found, removed, scan)
        found, group = refine_jointly(found, removed, group, scan)
    order = np.argsort(-found["amplitude"])
    found, group = found[order], group[order]
    power = beam_power(found, scan)
    inflation = variance_inflation(found, power, group, residual if effort.removes else None, scan)
    clock = clock_variance(*best_beams(power), scan_order(time, *cir["cir"].shape[:2]), sounder.clock.step)
    located = _located(found, scan)
    errors = {"inflation": inflation, "clock": clock, "pattern": pattern_covariance(found, group, scan)}
    of_located = {name: values[located] for name, values in errors.items()}
    table = tabulate(found[located], scan, distance, **of_located)
    table = with_elevation_gain(table, scan.directions, scan.pattern)
    period = scan.period / filter_.sample_rate
    late = table["delay"].values > threshold.delay_gate
    facts = {"threshold": str(threshold), "method": method, "complete": int(complete), "period": period}
    facts |= {"samples": scan.recorded.size * scan.period, "independent_samples": independent_samples(filter_)}
    left_out = {"paths_outside_fan": int((~located).sum()), "paths_beyond_gate": int(late.sum())}
    return table.isel(mpc=np.flatnonzero(~late)).assign_attrs(facts | left_out)


def _cancel(
    residual: NDArray[np.complex64], scan: Scan, effort: Effort
) -> tuple[NDArray[np.record], NDArray[np.complex64], bool]:
    """Paths by successive cancellation, the amplitude removed for each from each beam, and whether these are all."""
    view = scan.view(removes=bool(effort.removes))
    work = workspace(view)
    found, removed = np.zeros(CAPACITY, PATH), np.zeros((CAPACITY, len(residual)), np.complex64)
    count, complete = cancel(residual, view, effort, work, new_search(residual, work), found, removed)
    return found[:count], removed[:count], complete


def _located(found: NDArray[np.record], scan: Scan) -> NDArray[np.bool_]:
    """Whether each path is in the main lobe of its beam, so that its direction is known.

    A path far above or below the fan enters all beams alike through their sidelobes. Its delay is right, but its angle
    is not known. Nor is that of a path that the pattern does not fit.
    """
    known: NDArray[np.bool_] = ~(found["azimuth_variance"] > (scan.beamwidth[0] / 2) ** 2)
    if not scan.pattern.directive:
        return known & (found["beam_gain"] > 0.0)
    sidelobes = min(scan.pattern.sidelobe_level, scan.pattern.floor + 20 * np.log10(scan.pattern_margin))
    return known & (found["beam_gain"] > 10 ** ((sidelobes + LOCATED) / 20))
