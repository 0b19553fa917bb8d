"""Where along its line a wall stands: reflection points say yes, paths that pass through say no."""

from typing import NamedTuple

import numpy as np
from scipy.special import gammainc

from erm.geometry.vertical import FloatArray
from erm.reconstruction.model.line import Line
from erm.reconstruction.model.paths import BoolArray, IntArray
from erm.reconstruction.model.wall import Wall

CLEARANCE = 0.1  # m; a path that ends this near to a wall on its other side does not pass through it
SOLID = 5.0  # m; between reflection points closer than this there is no passage that only silence tells of
SILENT = 3  # links; of gaps that one or two did not see nine in ten were wall on random scenes, later three in four
ASTRAY = 0.05  # share of a wall's members that may come from anywhere
TELLING = 256  # paths of a wall that are asked where they pass; more tell no more
MOST_MARGIN = 0.5  # m; at grazing incidence the Fresnel zone is long, and half of it is enough to reflect


class Legs(NamedTuple):
    """Straight free stretches of paths: ``start`` and ``end`` (leg, 3) [m]."""

    start: FloatArray
    end: FloatArray


class Stretch(NamedTuple):
    """A piece of a wall: its members and how far it reaches along the line."""

    members: IntArray  # indices of the wall's members
    low: float  # m
    high: float  # m


class Footprint(NamedTuple):
    """All pieces of a wall as intervals along its line, with the height up to which each is known to stand."""

    line: Line
    low: FloatArray  # (piece,) m
    high: FloatArray  # (piece,) m
    top: FloatArray  # (piece,) m

    def pieces(self) -> list["Footprint"]:
        """Return each piece alone."""
        one = np.arange(len(self.low))
        return [Footprint(self.line, *(column[i : i + 1] for column in self[1:])) for i in one.tolist()]

    def blocks(self, legs: Legs) -> BoolArray:
        """Legs (leg,) that would have to pass through."""
        through, crossing = _crossings(self.line, legs)
        place = self.line.along(crossing)[:, None]
        hit = (place > self.low) & (place < self.high) & (crossing[:, 2:] < self.top)
        return through & hit.any(axis=1)


def without_strays(wall: Wall) -> tuple[Wall, IntArray]:
    """Return a wall that many saw where it stands, without the paths that agree with its line elsewhere; their indices.

    As many as `ASTRAY` of the members may come from anywhere, and lie along all of the line: those of thousands leave
    no gap in it. They would be ``2 SOLID ASTRAY n / span`` within `SOLID` of each; a member whose company so many of
    them have by chance that one of it is expected among twenty such walls is left out.
    """
    if wall.support <= TELLING:
        return wall, np.arange(wall.support)
    along = wall.line.along(wall.points)
    ranked = np.sort(along)
    company = np.searchsorted(ranked, along + SOLID, side="right") - np.searchsorted(ranked, along - SOLID) - 1
    strays = ASTRAY * wall.support
    # P(Poisson(m) >= k) is the regularised incomplete gamma function P(k, m)
    by_chance = gammainc(np.maximum(company, 1), 2 * SOLID * strays / max(ranked[-1] - ranked[0], 2 * SOLID))
    kept = np.flatnonzero((company > 0) & (strays * by_chance < 1 / 20))
    return Wall(wall.all_paths, wall.line, wall.members[kept]), kept


def legs_of(wall: Wall) -> Legs:
    """Both legs of each path, first all from the transmitters, then all from the receivers."""
    return Legs(np.vstack([wall.paths.tx, wall.paths.rx]), np.vstack([wall.points, wall.points]))


def fresnel_reach(wall: Wall) -> FloatArray:
    """Half length (member,) along the wall of the first Fresnel zone of each path [m].

    With ``d1``, ``d2`` from the reflection point to the antennas and ``cos`` the horizontal cosine of incidence,
    ``sqrt(wavelength d1 d2 / (d1 + d2)) / cos``: a face that reflects like a mirror is about that long.
    """
    first = np.linalg.norm(wall.points - wall.paths.tx, axis=-1)
    second = np.linalg.norm(wall.points - wall.paths.rx, axis=-1)
    radius = np.sqrt(wall.paths.wavelength * first * second / (first + second))
    return np.minimum(radius / np.maximum(wall.incidence, 1e-3), MOST_MARGIN)


def stretches(wall: Wall, max_gap: float, legs: Legs | None = None, silent: FloatArray | None = None) -> list[Stretch]:
    """Cut a wall where it cannot go on.

    A stretch ends at a gap between reflection points longer than ``max_gap``; at one through which a leg or a
    direct path passes below the higher of them, for there is a street and not a wall; and at one longer than
    ``SOLID`` within which ``SILENT`` antenna pairs should have seen a reflection and did not: one alone may have
    missed it. Each reaches beyond its outermost reflection points by their Fresnel zones, but not into a passage.

    Parameters
    ----------
    legs : Legs, optional
        Known free.
    silent : array (n,), optional
        Where along the wall a reflection was expected in vain [m].
    """
    along = wall.line.along(wall.points)
    order = np.argsort(along, kind="stable")
    along, height = along[order], wall.points[order, 2]
    gap = np.diff(along)
    ends = gap > max_gap
    passages = np.empty(0)
    if legs is not None:
        through, crossing = _crossings(wall.line, legs)
        place, up = wall.line.along(crossing[through]), crossing[through, 2]
        between = np.searchsorted(along, place)
        inside = (between > 0) & (between < len(along))
        left = between[inside] - 1
        below = up[inside] < np.maximum(height[left], height[left + 1])
        ends[left[below]] = True
        near = np.clip(between, 0, len(along) - 1)
        passages = place[up < np.maximum(height[near], height[np.maximum(near - 1, 0)])]
    if silent is not None and len(silent):
        between = np.searchsorted(along, silent)
        left = between[(between > 0) & (between < len(along))] - 1
        ends |= (np.bincount(left, minlength=len(gap)) >= SILENT) & (gap > SOLID)
    reach = fresnel_reach(wall)[order]
    result = []
    for run in np.split(np.arange(len(along)), np.flatnonzero(ends) + 1):
        low, high = along[run[0]], along[run[-1]]
        below_low, above_high = passages[passages < low], passages[passages > high]
        low_end = max(low - reach[run[0]], (low + below_low.max()) / 2 if len(below_low) else -np.inf)
        high_end = min(high + reach[run[-1]], (high + above_high.min()) / 2 if len(above_high) else np.inf)
        result.append(Stretch(order[run], float(low_end), float(high_end)))
    return result


def footprint(wall: Wall, pieces: list[Stretch]) -> Footprint:
    """Where a wall is known to stand."""
    top = [wall.points[piece.members, 2].max() for piece in pieces]
    low, high = [piece.low for piece in pieces], [piece.high for piece in pieces]
    return Footprint(wall.line, np.array(low), np.array(high), np.array(top))


def expected_places(line: Line, tx: FloatArray, rx: FloatArray) -> tuple[IntArray, FloatArray]:
    """Antenna pairs in front of a line, and where along it (pair,) it would reflect their paths [m]."""
    behind, before = line.depth(tx), line.depth(rx)
    front = np.flatnonzero((behind > CLEARANCE) & (before > CLEARANCE))
    share = before[front] / (behind[front] + before[front])
    here, there = line.along(rx[front]), line.along(tx[front])
    return front, here + share * (there - here)


def ends_of(wall: Wall, piece: Stretch) -> FloatArray:
    """End points (2, 2) of a piece [m]."""
    return wall.line.foot() + np.array([[piece.low], [piece.high]]) * wall.line.direction()


def _crossings(line: Line, legs: Legs) -> tuple[BoolArray, FloatArray]:
    """Which legs (leg,) pass from before to behind a line, and where (leg, 3) [m]."""
    start, end = line.depth(legs.start), line.depth(legs.end)
    through = (np.minimum(start, end) < -CLEARANCE) & (np.maximum(start, end) > CLEARANCE)
    share = np.where(through, start, 0.0) / np.where(through, start - end, 1.0)
    return through, legs.start + share[:, None] * (legs.end - legs.start)
