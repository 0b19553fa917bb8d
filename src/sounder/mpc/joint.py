"""Joint fit of MPCs whose pulses overlap, with one phase of each for all directions; and the MPCs missed among them.

Successive cancellation fits each path to what the others leave, with a phase of its own in every beam. Where pulses
overlap, that cannot separate the paths: of two paths 1 ns apart in one beam, the weaker one has an angle wrong by
degrees. If the horn turns about its phase centre, the phase between two paths is the same in all directions, and all
samples of all beams have few unknowns (`sounder.mpc.joint_fit`). The fit shows whether it is the same: paths are fitted
together where that leaves no more, for each free parameter, than phases of their own do, or than noise does.

Where the residuals hold one more path, it is added if it improves the fit by more than chance and the error of the
pattern allow, and is separate from the others. It becomes an MPC if it exceeds the threshold, is in the fan, and has a
known azimuth. That is also how a path found alone is told from two: a reflection and that of the ground before it.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from sounder.kernels.extraction.records import OVERLAP, PATH
from sounder.mpc.directions import wrap
from sounder.mpc.fit_parameters import AZIMUTH, AZIMUTH_GRID, DELAY, ELEVATION, LEVEL, PHASE, set_path
from sounder.mpc.joint_fit import PARAMETERS, JointFit, best_phases, fit_jointly
from sounder.mpc.scan import CANCELLATION_RESIDUAL, Scan
from sounder.mpc.two_paths_decision import MIN_SEPARATION
from sounder.mpc.whitened_samples import PADDING, BeamSamples, WindowPulse

Real = NDArray[np.float64]
Complex = NDArray[np.complexfloating]
Integers = NDArray[np.int64]
Paths = NDArray[np.record]

AZIMUTH_OVERLAP = 2.2
"""Paths closer than this in azimuth share samples [beamwidth]; with `OVERLAP` the half axes of an ellipse."""
MAX_GROUP = 8
"""Most paths of a group; the loosest ties beyond are cut. Bounds the time of a fit."""
BEAM_REACH = 2.2
"""Beams of a group: how far from one of its paths [beamwidth]; chosen, not derived."""
JOINT_IMPROVEMENT = 60.0
"""Least decrease of the squared residuals, in variances, for one more path. Five unknowns in a thousand numbers are
worth 35 (Bayes' information criterion), and there are many places where a path might be."""
MIN_PROMISE = 0.5
"""A path is tried where the best place, all else held, promises this share of `JOINT_IMPROVEMENT`; chosen."""
MAX_ADDED = 3
"""Most paths added to a group."""
DELAY_CELL = 1.1
"""Samples that separate paths as a beamwidth does: about the inverse of the band kept."""
JOINT_EXCESS = 1.5
"""Standard deviations by which the squared residuals may exceed those of noise."""
MAX_DELAY_MOVE = 1.5
"""How far a path may move in a fit [sample]; chosen, not derived."""
DELAY_GRID = 0.5
"""Step of the delays at which another path is looked for [sample]; chosen, not derived."""


def refine_jointly(found: Paths, removed: Complex, group: Integers, scan: Scan) -> tuple[Paths, Integers]:
    """Fit the MPCs that share samples again, together.

    Parameters
    ----------
    found : array of `PATH` (mpc,)
    removed : array complex (mpc, beam)
        Amplitude that cancellation removed for each MPC from each beam.
    group : array (mpc,)
        Number of the pair that was fitted together, -1 for others.
    scan : Scan

    Returns
    -------
    found : array of `PATH` (mpc,)
        With the MPCs added at the end.
    group : array (mpc,)
        Number of the group that was fitted together, -1 for others.
    """
    found, group, added = found.copy(), group.copy(), []
    for members in _groups(found, scan):
        if members.size == 2 and group[members[0]] == group[members[1]] >= 0:
            continue
        result = _fit_group(members, found, removed, scan)
        if result is None:
            continue
        best, noise, first = result
        records = np.zeros(len(best.paths), PATH)
        records[: members.size] = found[members]
        _set_records(records, best, noise, first, scan)
        number = group.max(initial=-1) + 1
        found[members], group[members] = records[: members.size], number
        added.append((records[members.size :][_listed(best, scan)[members.size :]], number))
    for records, number in added:
        found, group = np.concatenate([found, records]), np.append(group, np.full(len(records), number))
    return found, group


def _groups(found: Paths, scan: Scan) -> Iterator[Integers]:
    """MPCs that share samples, the closest tied first."""
    delay, azimuth = found["delay"], found["azimuth"]
    i, j = np.triu_indices(len(found), 1)
    late, aside = scan.delay_after(delay[i], delay[j]), wrap(azimuth[i] - azimuth[j])
    distance = np.hypot(late / OVERLAP, aside / (AZIMUTH_OVERLAP * scan.beamwidth[0]))
    group = np.arange(len(found))
    for tie in np.argsort(distance)[: int(np.sum(distance < 1))]:
        one, other = group[i[tie]], group[j[tie]]
        if one != other and np.sum((group == one) | (group == other)) <= MAX_GROUP:
            group[group == other] = one
    for number in np.unique(group):
        members = np.flatnonzero(group == number)
        yield members[np.argsort(-found["amplitude"][members])]


def _fit_group(members: Integers, found: Paths, removed: Complex, scan: Scan) -> tuple[JointFit, Real, int] | None:
    """Fit a group, the noise counted (link,), the window's first sample; None if less than a group explains as much."""
    paths = found[members]
    late = scan.delay_after(paths["delay"], paths["delay"][0])
    first = int(np.floor(paths["delay"][0] + late.min())) - PADDING
    window = scan.window_pulse(int(np.ceil(np.ptp(late))) + 2 * PADDING + 2)
    aside = wrap(paths["azimuth"] - paths["azimuth"][0])
    middle = paths["azimuth"][0] + (aside.min() + aside.max()) / 2
    beams, numbers = _samples(members, found, removed, first, middle, window, scan)
    start = np.zeros((members.size, PARAMETERS))
    start[:, AZIMUTH] = middle + wrap(paths["azimuth"] - middle)
    start[:, ELEVATION], start[:, LEVEL] = paths["elevation"], np.log(paths["amplitude"])
    start[:, DELAY] = scan.delay_after(paths["delay"], first)
    start[:, PHASE] = best_phases(start, beams, window, scan.cuts)
    pulse, _ = window.at(start[:, DELAY])
    own = removed[np.ix_(members, numbers)]
    residual = beams.samples - own.T @ pulse / np.sqrt(beams.noise)[:, None]
    freedom = max(2 * residual.size - 2 * np.count_nonzero(own) - members.size, 1)
    separate_misfit = 2 * np.sum(np.abs(residual) ** 2) / freedom
    best = fit_jointly(start, _bounds(start, scan), beams, window, scan.cuts)
    allowed = max(separate_misfit, 1 + JOINT_EXCESS / np.sqrt(best.residual.size))
    if members.size > 1 and (best.misfit > allowed or _separation(best.paths, scan) < MIN_SEPARATION):
        return None
    alone, _ = window.at(best.paths[:1, DELAY])
    for _ in range(MAX_ADDED):
        more = _with_another(best, beams, window, scan)
        if more is None:
            break
        best = more
    if members.size == 1 and not _differs_in_delay(best, alone, beams):
        return None
    counted = scan.noise.copy()
    counted[numbers] = beams.noise
    return (best, counted, first) if best.misfit <= allowed else None


def _differs_in_delay(fit: JointFit, pulse: Complex, beams: BeamSamples) -> bool:
    """Whether a fit is better than one ``pulse`` (1, combination) with any amplitude in each beam.

    That is what one path leaves in a horn that is not as described.
    """
    left = np.sum(np.abs(beams.samples) ** 2) - np.sum(np.abs(beams.samples @ pulse[0].conj()) ** 2) / np.sum(
        np.abs(pulse) ** 2
    )
    better = 2 * (left - np.sum(np.abs(fit.residual) ** 2))
    return bool(better > JOINT_IMPROVEMENT * max(1.0, fit.misfit))


def _samples(
    members: Integers,
    found: Paths,
    removed: Complex,
    first: int,
    middle: float,
    window: WindowPulse,
    scan: Scan,
) -> tuple[BeamSamples, Integers]:
    """Samples of the beams about a group without the other MPCs, and the numbers of the beams.

    What cancellation may have left of these, and the error of the pattern, count as noise.
    """
    aside = np.abs(wrap(scan.directions[scan.recorded, 0] - found["azimuth"][members, None])).min(axis=0)
    numbers = scan.recorded[aside <= BEAM_REACH * scan.beamwidth[0]]
    size = window.whitener.shape[1]
    samples = np.arange(size)
    data = scan.cir[np.ix_(numbers, (first + samples) % scan.period)].astype(complex)
    late = scan.delay_after(found["delay"], first)
    others = scan.overlaps(late, 0, size)
    others = others[~np.isin(others, members)]
    theirs = removed[np.ix_(others, numbers)]
    data -= theirs.T @ scan.pulse_at(samples - late[others, None])
    inside = (late[others] > 0) & (late[others] < size)
    noise = scan.noise[numbers] + CANCELLATION_RESIDUAL**2 * np.sum(np.abs(theirs[inside]) ** 2, axis=0)
    directions = scan.directions[numbers]
    directions[:, 0] = middle + wrap(directions[:, 0] - middle)
    beams = BeamSamples(directions, noise, data @ window.whitener.T / np.sqrt(noise)[:, None])
    return beams.with_pattern_error(*scan.antenna.pattern_error), numbers


def _bounds(paths: Real, scan: Scan) -> Real:
    """Lower and upper bound (2, path, 5) of the parameters of paths."""
    bounds = np.repeat(paths[None], 2, axis=0)
    for side, sign in enumerate((-1, 1)):
        bounds[side, :, AZIMUTH] += sign * scan.beamwidth[0]
        bounds[side, :, ELEVATION] = scan.elevation_range[side] + sign * 2 * scan.beamwidth[1]
        bounds[side, :, LEVEL] = sign * 60.0
        bounds[side, :, DELAY] += sign * MAX_DELAY_MOVE
        bounds[side, :, PHASE] += sign * 10 * np.pi
    return bounds


def _with_another(known: JointFit, beams: BeamSamples, window: WindowPulse, scan: Scan) -> JointFit | None:
    """Fit with one path more; None unless the fit is clearly better and the new path is a path."""
    start = _candidate(known, beams, window, scan)
    if start is None:
        return None
    paths = np.vstack([known.paths, start])
    more = fit_jointly(paths, _bounds(paths, scan), beams, window, scan.cuts)
    if 2 * (known.cost - more.cost) < JOINT_IMPROVEMENT * max(1.0, more.misfit):
        return None
    return more if _separation(more.paths, scan) >= MIN_SEPARATION else None


def _listed(fit: JointFit, scan: Scan) -> NDArray[np.bool_]:
    """Whether each path (path,) is an MPC: above the threshold, in the main lobe of a beam, of known azimuth.

    Others, such as a ground reflection below the fan, are fitted because they disturb the rest.
    """
    power = fit.paths[:, LEVEL] * 2 + np.log(10) / 10 * _gains(fit.paths, scan).max(axis=1)
    lowest, highest = scan.elevation_range + scan.beamwidth[1] / 2 * np.array([-1, 1])
    inside = (fit.paths[:, ELEVATION] >= lowest) & (fit.paths[:, ELEVATION] <= highest)
    azimuth_variance = np.diag(fit.covariance)[AZIMUTH::PARAMETERS]
    known_azimuth = azimuth_variance <= (scan.beamwidth[0] / 2) ** 2
    listed: NDArray[np.bool_] = (np.exp(power) > scan.threshold[scan.recorded].min()) & inside & known_azimuth
    return listed


def _separation(paths: Real, scan: Scan) -> float:
    """Least distance of two paths, in beamwidths or delay cells."""
    distance = (paths[:, None] - paths)[..., [AZIMUTH, ELEVATION, DELAY]] / np.append(scan.beamwidth, DELAY_CELL)
    return float(np.linalg.norm(distance, axis=-1)[np.triu_indices(len(paths), 1)].min(initial=np.inf))


def _candidate(known: JointFit, beams: BeamSamples, window: WindowPulse, scan: Scan) -> Real | None:
    """Parameters (5,) of the path that explains most of the residuals, if that may be enough.

    It explains ``|sum_b g_b q^H r_b|^2 / (|q|^2 sum_b g_b^2)`` of residuals ``r_b`` rotated to the phases of the
    directions.
    """
    east = beams.directions[:, 0]
    azimuth = np.arange(east.min(), east.max() + 0.1, AZIMUTH_GRID * scan.beamwidth[0])
    rows = np.unique(beams.directions[:, 1])
    elevation = np.concatenate([[rows[0] - scan.beamwidth[1] / 2], rows, [rows[-1] + scan.beamwidth[1] / 2]])
    delays = known.paths[:, DELAY]
    delay = np.arange(delays.min() - PADDING / 2, delays.max() + PADDING / 2, DELAY_GRID)
    pulse, _ = window.at(delay)
    azimuth, elevation = (grid.ravel()[:, None] for grid in np.meshgrid(azimuth, elevation, indexing="ij"))
    g = 10 ** (scan.pattern.beam_gain(azimuth, elevation, *beams.directions.T) / 20) / np.sqrt(beams.noise)
    amplitude = g @ (known.residual @ pulse.conj().T)
    energy = np.sum(g**2, axis=1)[:, None] * np.sum(np.abs(pulse) ** 2, axis=1)
    explained = np.abs(amplitude) ** 2 / energy
    place, when = np.unravel_index(np.argmax(explained), explained.shape)
    if 2 * explained[place, when] < MIN_PROMISE * JOINT_IMPROVEMENT:
        return None
    best = amplitude[place, when] / energy[place, when]
    start = np.empty(PARAMETERS)
    start[AZIMUTH], start[ELEVATION] = azimuth[place, 0], elevation[place, 0]
    start[LEVEL], start[DELAY], start[PHASE] = np.log(np.abs(best)), delay[when], np.angle(best)
    return start


def _gains(paths: Real, scan: Scan) -> Real:
    """Gains (path, beam) of the recorded beams toward paths [dB]."""
    return scan.gains(paths[:, AZIMUTH], paths[:, ELEVATION])[:, scan.recorded]


def _set_records(records: Paths, best: JointFit, noise: Real, first: int, scan: Scan) -> None:
    """Write a fit to links of ``noise`` (link,) to records; other directions that their beams do not exclude stay."""
    g = 10 ** (_gains(best.paths, scan) / 20)
    strongest = np.argmax(g, axis=1)
    covariance = best.covariance
    for p, (record, parameters) in enumerate(zip(records, best.paths, strict=True)):
        block = slice(PARAMETERS * p, PARAMETERS * (p + 1))
        beam = scan.recorded[strongest[p]]
        set_path(
            record,
            parameters,
            covariance[block, block],
            misfit=max(1.0, best.misfit) * noise[beam] / scan.noise[beam],
            beam=beam,
            beam_gain=g[p, strongest[p]],
            unit_delay_variance=scan.noise[beam] * scan.filter_.matched_filter.delay_variance,
        )
        record["delay"], record["residual_power"] = (first + parameters[DELAY]) % scan.period, 0.0
        elevation, amplitude = record["elevation_spread"], record["amplitude_spread"]
        record["elevation_variance"] += elevation**2
        record["amplitude_variance"] += amplitude**2
        record["elevation_amplitude"] += elevation * amplitude
