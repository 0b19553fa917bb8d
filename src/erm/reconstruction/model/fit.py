"""Lines fitted to paths, and how well paths agree with them; many lines in one go."""

from typing import NamedTuple

import numpy as np

from erm.geometry.vertical import FloatArray, angle_difference
from erm.reconstruction.model.line import Frame, Line, Lines
from erm.reconstruction.model.paths import IntArray, Paths, Rays
from erm.reconstruction.model.ragged import Ragged, sums

STEPS = 30  # of a fit, at most; five are the rule
HUBER = 2.0  # standard errors; residuals beyond pull with constant force (99 % efficient on Gaussian errors)
SETTLED = 1e-11  # degree, m; steps shorter than this are rounding
BATCH = 32768  # paths worked on in one go: few enough to stay in the processor's cache


class Residuals(NamedTuple):
    """Measured minus predicted length and azimuth (path,), and the predictions' slopes by (normal, offset)."""

    length: FloatArray  # m
    azimuth: FloatArray  # degree
    length_by_normal: FloatArray
    length_by_offset: FloatArray
    azimuth_by_normal: FloatArray
    azimuth_by_offset: FloatArray


def residuals(paths: Rays, frame: Frame) -> Residuals:
    """Measured minus predicted (length, azimuth) and the predictions' slopes by (normal, offset).

    The image ``VA = tx + 2 (o - n.tx) n`` moves by ``2 (o - n.tx) m - 2 (m.tx) n`` a radian, ``2 n`` a metre.
    """
    nx, ny, offset, px, py = frame  # m is (-ny, nx)
    tx_east, tx_north = paths.tx_east - px, paths.tx_north - py
    depth = offset - tx_east * nx - tx_north * ny
    aside = tx_north * nx - tx_east * ny
    east = tx_east - (paths.rx_east - px) + 2 * depth * nx
    north = tx_north - (paths.rx_north - py) + 2 * depth * ny
    square = east * east + north * north  # np.hypot takes ten times as long, for what no campaign overflows
    level, slant = np.sqrt(square), np.sqrt(square + paths.climb**2)
    cosine, sine = east / level, north / level
    toward_n, toward_m = cosine * nx + sine * ny, sine * nx - cosine * ny
    steep = 2 * level / slant
    # the left of the line of sight is (-sine, cosine): along n and m it is -toward_m and toward_n
    return Residuals(
        length=paths.length - slant,
        azimuth=angle_difference(paths.azimuth, np.rad2deg(np.arctan2(north, east))),
        length_by_normal=np.deg2rad(depth * toward_m - aside * toward_n) * steep,
        length_by_offset=toward_n * steep,
        azimuth_by_normal=2 * (depth * toward_n + aside * toward_m) / level,
        azimuth_by_offset=np.rad2deg(-2 * toward_m / level),
    )


def chi_squared(
    paths: Rays, residual: Residuals, variance: tuple[FloatArray | float, FloatArray | float, FloatArray | float]
) -> FloatArray:
    """``r' (S + J C J')**-1 r`` of residuals (path,) in length and azimuth.

    ``S`` is the paths' own variance, ``J`` the predictions' slopes and ``C`` the covariance of the parameters, whose
    ``variance`` is (of the normal, of both, of the offset), numbers or arrays (path,).
    """
    r, s, rn, ro, sn, so = residual
    normal, both, offset = variance
    of_normal, of_offset = rn * normal + ro * both, rn * both + ro * offset
    length = of_normal * rn + of_offset * ro + paths.length_std**2
    mixed = of_normal * sn + of_offset * so
    azimuth = sn * sn * normal + 2 * sn * so * both + so * so * offset + paths.azimuth_std**2
    return (r * r * azimuth - 2 * r * s * mixed + s * s * length) / (length * azimuth - mixed**2)


def misfit(paths: Paths, line: Line) -> FloatArray:
    """Chi-squared (path,) of each path against a wall, the wall's own uncertainty included.

    Infinite where an antenna stands behind the wall.
    """
    (a, b), (_, d) = line.covariance.tolist()
    return _misfit(paths.rays, line.frame(), (a, b, d))


def misfits(paths: Rays, rows: IntArray, lines: Lines, of: IntArray) -> FloatArray:
    """Chi-squared (row,) of `misfit` of rows of the paths, each against one of many lines."""
    found = np.empty(len(rows))
    frames = np.stack(lines.frames())
    variances = np.ascontiguousarray(lines.covariance[:, [0, 0, 1], [0, 1, 1]].T)
    for first in range(0, len(rows), BATCH):
        part = slice(first, first + BATCH)
        own = of[part]
        a, b, d = (column[own] for column in variances)
        found[part] = _misfit(paths.take(rows[part]), Frame(*(column[own] for column in frames)), (a, b, d))
    return found


def _misfit(
    paths: Rays, frame: Frame, variance: tuple[FloatArray | float, FloatArray | float, FloatArray | float]
) -> FloatArray:
    chi2 = chi_squared(paths, residuals(paths, frame), variance)
    tx, rx = frame.before(paths.tx_east, paths.tx_north), frame.before(paths.rx_east, paths.rx_north)
    chi2[~(np.minimum(tx, rx) > 0)] = np.inf
    return chi2


def fit_line(paths: Paths, start: Line, steps: int = STEPS) -> Line:
    """Most likely wall of a set of paths, from a nearby start; see `fit_lines`."""
    members = Ragged(np.arange(len(paths)), np.array([0, len(paths)]))
    return fit_lines(paths.rays, members, Lines.of([start]), np.array([steps])).one(0)


def fit_lines(paths: Rays, members: Ragged, starts: Lines, steps: IntArray | int = STEPS) -> Lines:
    """Most likely walls of sets of paths, by reweighted Gauss-Newton steps from nearby starts.

    Each minimises the sum over its paths of ``h((L - L(wall)) / s_L) + h((a - a(wall)) / s_a)`` with Huber's ``h``:
    squares up to `HUBER` standard errors and straight lines beyond, so that a path from elsewhere, or one whose
    delay another path pulled aside, does not bend the wall. The covariance is the inverse of the weighted normal
    matrix, that is, it takes the standard errors at their word.

    Parameters
    ----------
    paths : Rays
    members : Ragged
        Paths of each wall; none is empty.
    starts : Lines
    steps : array (wall,) or int
        Most steps of each.
    """
    steps = np.broadcast_to(steps, len(members))
    parts = []
    for part in members.parts(BATCH):
        some = members.part(part)
        parts.append(_fitted(paths.take(some.rows), some.start, starts.take(part), steps[part]))
    return Lines(*(np.concatenate(columns) for columns in zip(*parts, strict=True))) if parts else starts


def _fitted(paths: Rays, start: IntArray, lines: Lines, steps: IntArray) -> Lines:
    """Fit lines to stretches of paths, the first from ``start[0]`` to ``start[1]``."""
    going = Ragged(np.arange(start[-1]), start)
    of = going.owner
    east, north = lines.frames(of).bounce(paths)
    lines = lines.about(sums(np.stack([east, north], axis=-1), start) / going.sizes[:, None])
    fitted, which, taken = lines, np.arange(len(going)), 0
    while len(which):
        lines, step = _stepped(paths, of, going.start, lines)
        taken += 1
        done = (np.abs(step).max(axis=1) < SETTLED) | (taken >= steps)
        if done.any():
            fitted = fitted.put(which[done], lines.take(done))
            rest = np.flatnonzero(~done)
            which, lines, steps, going = which[rest], lines.take(rest), steps[rest], going.take(rest)
            paths = paths.take(going.rows)
            going = Ragged(np.arange(going.start[-1]), going.start)
            of = going.owner
    return fitted


def _stepped(paths: Rays, of: IntArray, start: IntArray, lines: Lines) -> tuple[Lines, FloatArray]:
    """Lines after one Gauss-Newton step, with their covariances before it, and the steps (line, 2)."""
    residual = residuals(paths, lines.frames(of))
    terms = np.zeros((5, len(of)))
    for value, by_normal, by_offset, std in (
        (residual.length, residual.length_by_normal, residual.length_by_offset, paths.length_std),
        (residual.azimuth, residual.azimuth_by_normal, residual.azimuth_by_offset, paths.azimuth_std),
    ):
        weight = np.minimum(1.0, HUBER / np.maximum(np.abs(value / std), HUBER)) / std**2
        of_normal, of_offset = weight * by_normal, weight * by_offset
        terms[0] += of_normal * by_normal
        terms[1] += of_normal * by_offset
        terms[2] += of_offset * by_offset
        terms[3] += of_normal * value
        terms[4] += of_offset * value
    a, b, d, u, v = np.add.reduceat(terms, start[:-1], axis=1)
    determinant = a * d - b * b
    covariance = np.stack([d, -b, -b, a], axis=-1).reshape(-1, 2, 2) / determinant[:, None, None]
    step = np.stack([d * u - b * v, a * v - b * u], axis=-1) / determinant[:, None]
    return Lines((lines.normal + step[:, 0]) % 360, lines.offset + step[:, 1], covariance, lines.pivot), step
