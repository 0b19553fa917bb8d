"""Paths that share samples, fitted together with one phase of each for all directions, and those missed among them.

Successive cancellation fits each path to what the others leave, with a phase of its own in every beam. Where pulses
overlap, that leaves it unsettled what is whose: of two paths 1 ns apart in one beam, the weaker has an angle wrong by
degrees. If the horn turns about its phase centre, the phase between two paths is the same in all directions, and all
samples of all beams have few unknowns (`sounder.mpc.joint_fit`). Whether it is, the fit tells: paths are fitted
together where that leaves no more, for each number that is free, than phases of their own do or than noise.

Where the residuals hold one more path, it is added if it makes the fit better by more than chance and what is not known
of the pattern allow, stands over the threshold and apart from the others, and has an azimuth.
"""

from collections.abc import Iterator
from functools import cache

import numpy as np
from numpy.typing import NDArray

from sounder.cir.deembedding import Deembedding
from sounder.cir.matched_filter import OVERSAMPLING
from sounder.instrument.antenna_pattern import Pattern
from sounder.kernels.extraction import columns
from sounder.mpc.fitted import turn, write_path
from sounder.mpc.joint_fit import COLUMNS, PHASE, Fit, Window, fit, phases
from sounder.mpc.pattern_slopes import Cuts
from sounder.mpc.two_paths_fit import AZIMUTH, DELAY, ELEVATION, LEVEL, Beams
from sounder.mpc.two_paths_test import LEAST

Real = NDArray[np.float64]
Integers = NDArray[np.int64]

LATE, ASIDE = 6.0, 2.2
"""How far apart paths are that share samples: delays [sample], azimuths [beamwidth], as half axes of an ellipse."""
MOST = 8
"""Most paths of a group; beyond, the loosest ties are cut."""
PAD = 6
"""Samples before and after a group."""
AROUND = 2.2
"""Beams of a group: how far from one of its paths, in beamwidths."""
LEFTOVER = 0.1
"""Amplitude that cancellation leaves of paths outside a group, relative."""
CRITERION = 60.0
"""Squared residuals, in variances, by which a path must better a fit: five unknowns in a thousand numbers are worth 35
(Bayes' information criterion), and there are many places where another path might be."""
MORE = 3
"""Most paths added to a group."""
AGAIN = 0.5
"""Share of `CRITERION` that the best place promises, all else held, from which on a path is tried there."""
CELL = 1.1
"""Samples that keep paths apart as a beamwidth does: the inverse of the band kept."""
FITS = 1.5
"""Deviations of the squared residuals by which noise may leave more than is expected."""
KNOWN = 0.005, 0.01
"""Relative errors of the pattern that are allowed for: of the gain, and of the lobe's width."""
STRAY = 1.5
"""Samples that a path may move."""
GRID = 0.25, 0.5
"""Steps of the search for another path: azimuth [beamwidth], delay [sample]."""


class Scan:
    """What all groups of a position are fitted with."""

    def __init__(
        self,
        beams: NDArray[np.complexfloating],
        noise: Real,
        looks: Real,
        widths: tuple[float, float],
        pattern: Pattern,
        filter_: Deembedding,
        threshold: Real,
    ) -> None:
        self.cuts = Cuts.of(pattern)
        self.beams, self.noise, self.looks, self.pattern, self.threshold = beams, noise, looks, pattern, threshold
        self.recorded = np.flatnonzero(np.isfinite(noise))
        self.widths, self.pulse, self.spread = (
            np.array(widths),
            filter_.matched_filter.pulse,
            filter_.matched_filter.delay_variance,
        )
        self.window = cache(lambda size: Window.of(filter_.matched_filter, filter_.noise, size))

    def since(self, delay: Real, first: Real | float) -> Real:
        """Delays after another [sample], the short way round."""
        size = self.beams.shape[1]
        return (delay - first + size / 2) % size - size / 2


def refine(found: Real, taken: NDArray[np.complexfloating], pair: Integers, scan: Scan) -> tuple[Real, Integers]:
    """Fit the MPCs that share samples again, together.

    Parameters
    ----------
    found : array (mpc, component.COLUMNS)
    taken : array complex (mpc, beam)
        What was taken for each in each beam.
    pair : array (mpc,)
        Number of the pair that was fitted together, -1 for others.
    scan : Scan
        The CIRs and what they are seen with.

    Returns
    -------
    found : array (mpc, component.COLUMNS)
        With those added at the end.
    pair : array (mpc,)
        Number of the group that was fitted together.
    """
    found, pair, added = found.copy(), pair.copy(), []
    for group in _groups(found, scan):
        if group.size < 2 or (group.size == 2 and pair[group[0]] == pair[group[1]] >= 0):
            continue
        result = _together(group, found, taken, scan)
        if result is None:
            continue
        best, first = result
        rows = np.zeros((len(best.paths), columns.COLUMNS))
        rows[: group.size] = found[group]
        _write(rows, best, first, scan)
        number = pair.max(initial=-1) + 1
        found[group], pair[group] = rows[: group.size], number
        added.append((rows[group.size :], number))
    for rows, number in added:
        found, pair = np.concatenate([found, rows]), np.append(pair, np.full(len(rows), number))
    return found, pair


def _groups(found: Real, scan: Scan) -> Iterator[Integers]:
    """MPCs that share samples, the closest tied first."""
    delay, azimuth = found[:, columns.DELAY], found[:, columns.AZIMUTH]
    i, j = np.triu_indices(len(found), 1)
    apart = np.hypot(scan.since(delay[i], delay[j]) / LATE, turn(azimuth[i] - azimuth[j]) / (ASIDE * scan.widths[0]))
    group = np.arange(len(found))
    for tie in np.argsort(apart)[: int(np.sum(apart < 1))]:
        one, other = group[i[tie]], group[j[tie]]
        if one != other and np.sum((group == one) | (group == other)) <= MOST:
            group[group == other] = one
    for number in np.unique(group):
        members = np.flatnonzero(group == number)
        yield members[np.argsort(-found[members, columns.AMPLITUDE])]


def _together(group: Integers, found: Real, taken: NDArray[np.complexfloating], scan: Scan) -> tuple[Fit, int] | None:
    """Fit a group; None if phases of their own explain it better. With the window's first sample."""
    rows = found[group]
    late = scan.since(rows[:, columns.DELAY], rows[0, columns.DELAY])
    first = int(np.floor(rows[0, columns.DELAY] + late.min())) - PAD
    window = scan.window(int(np.ceil(np.ptp(late))) + 2 * PAD + 2)
    aside = turn(rows[:, columns.AZIMUTH] - rows[0, columns.AZIMUTH])
    middle = rows[0, columns.AZIMUTH] + (aside.min() + aside.max()) / 2
    beams, which = _beams(group, found, taken, first, middle, window, scan)
    paths = np.zeros((group.size, COLUMNS))
    paths[:, AZIMUTH] = middle + turn(rows[:, columns.AZIMUTH] - middle)
    paths[:, ELEVATION], paths[:, LEVEL] = rows[:, columns.ELEVATION], np.log(rows[:, columns.AMPLITUDE])
    paths[:, DELAY] = scan.since(rows[:, columns.DELAY], first)
    paths[:, PHASE] = phases(paths, beams, window, scan.cuts)
    pulse, _ = window.at(paths[:, DELAY])
    own = taken[np.ix_(group, which)]
    left = beams.data - own.T @ pulse / np.sqrt(beams.noise)[:, None]
    alone = 2 * np.sum(np.abs(left) ** 2) / max(2 * left.size - 2 * np.count_nonzero(own) - group.size, 1)
    best = fit(paths, _bounds(paths, scan), beams, window, scan.cuts)
    if best.misfit > max(alone, 1 + FITS / np.sqrt(best.left.size)) or _closest(best.paths, scan) < LEAST:
        return None
    for _ in range(MORE):
        more = _with_another(best, beams, window, scan)
        if more is None:
            break
        best = more
    return best, first


def _beams(
    group: Integers,
    found: Real,
    taken: NDArray[np.complexfloating],
    first: int,
    middle: float,
    window: Window,
    scan: Scan,
) -> tuple[Beams, Integers]:
    """Beams about a group, less other MPCs, with what is left of these and not known of the pattern as noise."""
    looks = scan.looks[scan.recorded]
    aside = np.abs(turn(looks[:, 0] - found[group, columns.AZIMUTH, None])).min(axis=0)
    which = scan.recorded[aside <= AROUND * scan.widths[0]]
    size = window.whitener.shape[1]
    samples = np.arange(size)
    data = scan.beams[np.ix_(which, (first + samples) % scan.beams.shape[1])].astype(complex)
    late = scan.since(found[:, columns.DELAY], first)
    reach = scan.pulse.size / OVERSAMPLING / 2
    others = np.flatnonzero((late > -reach) & (late < size + reach))
    others = others[~np.isin(others, group)]
    place = np.rint((samples - late[others, None]) * OVERSAMPLING).astype(int) + scan.pulse.size // 2
    inside = (place >= 0) & (place < scan.pulse.size)
    theirs = taken[np.ix_(others, which)]
    data -= theirs.T @ np.where(inside, scan.pulse[np.where(inside, place, 0)], 0)
    near = (late[others] > 0) & (late[others] < size)
    noise = scan.noise[which] + LEFTOVER**2 * np.sum(np.abs(theirs[near]) ** 2, axis=0)
    data = data @ window.whitener.T / np.sqrt(noise)[:, None]
    power = np.maximum(np.sum(np.abs(data) ** 2, axis=1) - data.shape[1], 1e-3)
    error = KNOWN[0] + KNOWN[1] * np.log(power.max() / power)
    vague = 1 + 2 * error**2 * power
    looks = scan.looks[which].copy()
    looks[:, 0] = middle + turn(looks[:, 0] - middle)
    return Beams(looks, noise * vague, data / np.sqrt(vague)[:, None]), which


def _bounds(paths: Real, scan: Scan) -> Real:
    """Least and most (2, path, 5) of the parameters of paths."""
    up = scan.looks[scan.recorded, 1]
    bounds = np.repeat(paths[None], 2, axis=0)
    for side, sign in enumerate((-1, 1)):
        bounds[side, :, AZIMUTH] += sign * scan.widths[0]
        bounds[side, :, ELEVATION] = (up.min(), up.max())[side] + sign * 2 * scan.widths[1]
        bounds[side, :, LEVEL] = sign * 60.0
        bounds[side, :, DELAY] += sign * STRAY
        bounds[side, :, PHASE] += sign * 10 * np.pi
    return bounds


def _with_another(known: Fit, beams: Beams, window: Window, scan: Scan) -> Fit | None:
    """Fit with one path more; None unless that is clearly better and the path is one."""
    start = _candidate(known, beams, window, scan)
    if start is None:
        return None
    paths = np.vstack([known.paths, start])
    more = fit(paths, _bounds(paths, scan), beams, window, scan.cuts)
    if 2 * (known.cost - more.cost) < CRITERION * max(1.0, more.misfit):
        return None
    new = more.paths[-1]
    up = scan.looks[scan.recorded, 1]
    high = max(new[ELEVATION] - up.max(), up.min() - new[ELEVATION])
    vague = more.covariance[-COLUMNS + AZIMUTH, -COLUMNS + AZIMUTH] > (scan.widths[0] / 2) ** 2
    if vague or high > scan.widths[1] / 2 or _closest(more.paths, scan) < LEAST:
        return None
    seen = more.paths[:, LEVEL] * 2 + np.log(10) / 10 * _gains(more.paths, scan).max(axis=1)
    return more if (np.exp(seen) > scan.threshold[scan.recorded].min()).all() else None


def _closest(paths: Real, scan: Scan) -> float:
    """Least distance of two paths, in beamwidths or what keeps paths apart in delay."""
    apart = (paths[:, None] - paths)[..., [AZIMUTH, ELEVATION, DELAY]] / np.append(scan.widths, CELL)
    return float(np.linalg.norm(apart, axis=-1)[np.triu_indices(len(paths), 1)].min())


def _candidate(known: Fit, beams: Beams, window: Window, scan: Scan) -> Real | None:
    """Parameters (5,) of the path that explains most of what is left, if that may be enough.

    ``|sum_b g_b q^H r_b|^2 / (|q|^2 sum_b g_b^2)`` for residuals ``r_b`` turned to the phases of the directions.
    """
    azimuth = np.arange(beams.looks[:, 0].min(), beams.looks[:, 0].max() + 0.1, GRID[0] * scan.widths[0])
    up = np.unique(beams.looks[:, 1])
    elevation = np.concatenate([[up[0] - scan.widths[1] / 2], up, [up[-1] + scan.widths[1] / 2]])
    inside = known.paths[:, DELAY]
    delay = np.arange(inside.min() - PAD / 2, inside.max() + PAD / 2, GRID[1])
    pulse, _ = window.at(delay)
    toward, high = (grid.ravel()[:, None] for grid in np.meshgrid(azimuth, elevation, indexing="ij"))
    g = 10 ** (scan.pattern.beam_gain(toward, high, *beams.looks.T) / 20) / np.sqrt(beams.noise)
    amplitude = g @ (known.left @ pulse.conj().T)
    energy = np.sum(g**2, axis=1)[:, None] * np.sum(np.abs(pulse) ** 2, axis=1)
    gain = np.abs(amplitude) ** 2 / energy
    place, when = np.unravel_index(np.argmax(gain), gain.shape)
    if 2 * gain[place, when] < AGAIN * CRITERION:
        return None
    amplitude = amplitude[place, when] / energy[place, when]
    start = np.empty(COLUMNS)
    start[AZIMUTH], start[ELEVATION] = toward[place, 0], high[place, 0]
    start[LEVEL], start[DELAY], start[PHASE] = np.log(np.abs(amplitude)), delay[when], np.angle(amplitude)
    return start


def _gains(paths: Real, scan: Scan) -> Real:
    """Gains (path, beam) of the recorded beams toward paths [dB]."""
    toward = paths[:, AZIMUTH, None], paths[:, ELEVATION, None]
    return np.asarray(scan.pattern.beam_gain(*toward, *scan.looks[scan.recorded].T))


def _write(rows: Real, best: Fit, first: int, scan: Scan) -> None:
    """Write paths as `found` has them; what other directions they do not exclude stays."""
    g = 10 ** (_gains(best.paths, scan) / 20)
    beam = np.argmax(g, axis=1)
    every = best.covariance
    for p, (row, path) in enumerate(zip(rows, best.paths, strict=True)):
        own = every[COLUMNS * p : COLUMNS * (p + 1), COLUMNS * p : COLUMNS * (p + 1)]
        sees = scan.recorded[beam[p]]
        write_path(row, path, own, best.misfit, (sees, g[p, beam[p]], scan.noise[sees] * scan.spread))
        row[columns.DELAY], row[columns.LEFT_OVER] = (first + path[DELAY]) % scan.beams.shape[1], 0.0
        up, stronger = row[columns.ELEVATION_SPREAD], row[columns.AMPLITUDE_SPREAD]
        row[columns.VAR_ELEVATION] += up**2
        row[columns.VAR_AMPLITUDE] += stronger**2
        row[columns.ELEVATION_AMPLITUDE] += up * stronger
