"""Multipath components (MPCs): delay, angle of arrival and path gain of the paths in a CIR, with their errors."""

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from sounder.cir.deembedding import Deembedding
from sounder.instrument.description import Sounder
from sounder.kernels.extraction.peak_search import new_search
from sounder.kernels.extraction.records import ARRIVAL, DEPARTURE, PATH
from sounder.kernels.extraction.sage import Effort, cancel
from sounder.kernels.extraction.workspace import workspace
from sounder.mpc.beams import Beams
from sounder.mpc.clock import clock_variance, scan_order
from sounder.mpc.common_delays import refine_delays
from sounder.mpc.departures import with_departures
from sounder.mpc.elevation_gain import with_elevation_gain
from sounder.mpc.hidden import ambiguity, widen
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
    (:mod:`sounder.mpc.joint`). Where the transmit antenna has several beams too, all this is of links, pairs of beams
    at departure and arrival, whose gain is the product of both patterns; departure and arrival are fitted in turn
    (:mod:`sounder.kernels.extraction.fit_path`). Two paths of one arrival are then told apart by their departure, and
    the two last steps are left out. For the errors see :func:`sounder.mpc.table.tabulate`; those of one path alone are
    up to 1.16 times the Cramer-Rao bound.

    Parameters
    ----------
    cir : xarray.Dataset
        ``cir`` (azimuth, elevation, delay), from :func:`sounder.cir.impulse_response.impulse_responses`, or
        (tx_azimuth, tx_elevation, azimuth, elevation, delay).
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
        :func:`sounder.mpc.elevation_gain.with_elevation_gain`, and with several beams of the transmit antenna those of
        :func:`sounder.mpc.departures.with_departures`. Attributes: ``paths_outside_fan``, the number of paths
        left out because only sidelobes see them, or flanks beside missing directions (:mod:`sounder.mpc.hidden`), so
        that their angles are not known; ``paths_beyond_gate``, the number
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
    found, departure, removed, complete = _cancel(residual, scan, effort)
    group = np.full(len(found), -1)
    grid = scan.azimuth.size > 2 and scan.elevation.size > 1 and scan.departure.size == 1
    if effort.passes and grid and scan.pattern.directive:
        found, removed, group = split_paths(found, removed, scan)
        found, group = refine_jointly(found, removed, group, scan)
        departure = np.zeros(len(found), PATH)
    if effort.passes and scan.departure.size > 1:
        found = refine_delays(found, beam_power(found, scan, departure), removed, residual, scan)
    order = np.argsort(-found["amplitude"])
    found, departure, group = found[order], departure[order], group[order]
    power = beam_power(found, scan, departure)
    inflation = variance_inflation(found, power, group, residual if effort.removes else None, scan)
    turned = scan_order(time, scan.azimuth.size, scan.elevation.size)
    in_turn = np.add.outer(scan.arrival.size * np.arange(scan.departure.size), turned).ravel()
    clock = clock_variance(*best_beams(power), in_turn, sounder.clock.step)
    ends = {ARRIVAL: (found, scan.arrival), DEPARTURE: (departure, scan.departure)}
    pattern = [pattern_covariance(of, group, beams, scan.recorded_beams(end)) for end, (of, beams) in ends.items()]
    pattern[ARRIVAL][:, 2, 2] += pattern[DEPARTURE][:, 2, 2]
    gain = found["beam_gain"] / departure["beam_gain"] if scan.departure.size > 1 else found["beam_gain"]
    located = _located(found, gain, scan.arrival)
    doubtful = ambiguity(found, scan)
    located &= doubtful.known | (effort.removes == 0)
    errors = {"inflation": inflation, "clock": clock, "pattern": pattern[ARRIVAL]}
    of_located = {name: values[located] for name, values in errors.items()}
    table = tabulate(found[located], scan, distance, **of_located)
    widen(table, doubtful.azimuth[located], doubtful.gain[located])
    table = with_elevation_gain(table, scan.directions, scan.pattern)
    if scan.departure.size > 1:
        seen = _located(departure, departure["beam_gain"], scan.departure)[located]
        table = with_departures(
            table, departure[located], seen, scan, inflation[located, 1], pattern[DEPARTURE][located]
        )
    period = scan.period / filter_.sample_rate
    late = table["delay"].values > threshold.delay_gate
    facts = {"threshold": str(threshold), "method": method, "complete": int(complete), "period": period}
    facts |= {"samples": scan.recorded.size * scan.period, "independent_samples": independent_samples(filter_)}
    left_out = {"paths_outside_fan": int((~located).sum()), "paths_beyond_gate": int(late.sum())}
    return table.isel(mpc=np.flatnonzero(~late)).assign_attrs(facts | left_out)


def _cancel(
    residual: NDArray[np.complex64], scan: Scan, effort: Effort
) -> tuple[NDArray[np.record], NDArray[np.record], NDArray[np.complex64], bool]:
    """Arrivals and departures by cancellation, what was removed from each link, and whether these are all."""
    view = scan.view(removes=bool(effort.removes))
    work = workspace(view)
    found, removed = np.zeros((CAPACITY, 2), PATH), np.zeros((CAPACITY, len(residual)), np.complex64)
    count, complete = cancel(residual, view, effort, work, new_search(residual, work), found, removed)
    return found[:count, ARRIVAL].copy(), found[:count, DEPARTURE].copy(), removed[:count], complete


def _located(found: NDArray[np.record], gain: NDArray[np.float64], beams: Beams) -> NDArray[np.bool_]:
    """Whether each path is in the main lobe of its beam at one end, so that its direction is known.

    ``gain`` (mpc,) is the amplitude of that beam's pattern toward it.

    A path far above or below the fan enters all beams alike through their sidelobes. Its delay is right, but its angle
    is not known. Nor is that of a path that the pattern does not fit.
    """
    known: NDArray[np.bool_] = ~(found["azimuth_variance"] > (beams.beamwidth[0] / 2) ** 2)
    if not beams.pattern.directive:
        return known & (gain > 0.0)
    sidelobes = min(beams.pattern.sidelobe_level, beams.pattern.floor + 20 * np.log10(beams.margin))
    return known & (gain > 10 ** ((sidelobes + LOCATED) / 20))
