"""Extent of a wall along its line.

Reflection points show where it stands, and paths that pass through show where it does not.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import betaln, gammainc

from erm.common.odds import TWENTY_TO_ONE
from erm.geometry.vertical import FloatArray
from erm.reconstruction.model.line import Line
from erm.reconstruction.model.paths import BoolArray, IntArray
from erm.reconstruction.model.wall import Wall

CLEARANCE = 0.1
"""Distance behind a wall up to which a path that ends there does not pass through it [m]. Chosen; not derived."""
SOLID_GAP = 5.0
"""Gap between reflection points up to which a wall is taken to be solid, unless a path passes through [m]. Chosen; not
derived."""
STRAY_SHARE = 0.05
"""Largest share of a wall's inliers that may be from elsewhere. Chosen; not derived."""
MAX_TESTED_PATHS = 256
"""Paths of a wall that are tested for what they pass through. Chosen; more give no more information."""
MAX_FRESNEL_MARGIN = 0.5
"""Largest length that a wall reaches beyond its outermost reflection points [m]. At grazing incidence the Fresnel zone
is long, and half of it is enough to reflect. Chosen; not derived."""


class Legs(NamedTuple):
    """Straight unobstructed legs of paths: ``start`` and ``end`` (leg, 3) [m]."""

    start: FloatArray
    end: FloatArray


class Piece(NamedTuple):
    """A piece of a wall: its paths and its ends along the line."""

    inliers: IntArray  # indices of the wall's inliers
    low: float  # m
    high: float  # m
    unseen: FloatArray  # (2,) m, beyond either end, up to which it may go on; NaN where nothing shows its end


class Footprint(NamedTuple):
    """All pieces of a wall as intervals along its line, with the height up to which each is known to stand."""

    line: Line
    low: FloatArray  # (piece,) m
    high: FloatArray  # (piece,) m
    top: FloatArray  # (piece,) m

    def pieces(self) -> list["Footprint"]:
        """Return each piece alone."""
        return [Footprint(self.line, *(column[i : i + 1] for column in self[1:])) for i in range(len(self.low))]

    def blocks(self, legs: Legs) -> BoolArray:
        """Whether (leg,) legs would pass through the wall."""
        crosses, crossing = _crossings(self.line, legs)
        place = self.line.along(crossing)[:, None]
        hit = (place > self.low) & (place < self.high) & (crossing[:, 2:] < self.top)
        return crosses & hit.any(axis=1)


def without_strays(wall: Wall) -> tuple[Wall, IntArray]:
    """Remove paths from a well-supported wall that agree with its line but are isolated along it.

    Up to `STRAY_SHARE` of the ``n`` inliers may be strays: paths from elsewhere, spread over the whole line. On a wall
    with thousands of paths they would hide every gap. Within `SOLID_GAP` of a point,
    ``2 SOLID_GAP STRAY_SHARE n / span`` strays are expected. An inlier is kept if the expected number of strays with as
    many neighbours as it has is below 1 / 20.

    Parameters
    ----------
    wall : Wall
        Returned as it is if it has at most `MAX_TESTED_PATHS` inliers.

    Returns
    -------
    wall : Wall
    kept : array (inlier,) of int
        Indices of the inliers that were kept.
    """
    if wall.support <= MAX_TESTED_PATHS:
        return wall, np.arange(wall.support)
    along = wall.line.along(wall.reflection_points)
    ranked = np.sort(along)
    neighbours = (
        np.searchsorted(ranked, along + SOLID_GAP, side="right") - np.searchsorted(ranked, along - SOLID_GAP) - 1
    )
    strays = STRAY_SHARE * wall.support
    # P(Poisson(m) >= k) is the regularised incomplete gamma function P(k, m)
    by_chance = gammainc(np.maximum(neighbours, 1), 2 * SOLID_GAP * strays / max(ranked[-1] - ranked[0], 2 * SOLID_GAP))
    kept = np.flatnonzero((neighbours > 0) & (strays * by_chance < 1 / 20))
    return Wall(wall.all_paths, wall.line, wall.inliers[kept]), kept


def legs_of(wall: Wall) -> Legs:
    """Both legs of each path: first all from the transmitters, then all from the receivers."""
    return Legs(np.vstack([wall.paths.tx, wall.paths.rx]), np.vstack([wall.reflection_points, wall.reflection_points]))


def fresnel_margin(wall: Wall) -> FloatArray:
    """Half length (inlier,) along the wall of the first Fresnel zone of each path, up to `MAX_FRESNEL_MARGIN` [m].

    With the distances ``d1`` and ``d2`` from the reflection point to the antennas and the cosine of incidence ``cos``
    it is ``sqrt(wavelength d1 d2 / (d1 + d2)) / cos``. A face that reflects specularly is about that long.
    """
    first = np.linalg.norm(wall.reflection_points - wall.paths.tx, axis=-1)
    second = np.linalg.norm(wall.reflection_points - wall.paths.rx, axis=-1)
    radius = np.sqrt(wall.paths.wavelength * first * second / (first + second))
    return np.minimum(radius / np.maximum(wall.cos_incidence, 1e-3), MAX_FRESNEL_MARGIN)


def cut_wall(wall: Wall, max_gap: float, legs: Legs | None = None, missed: FloatArray | None = None) -> list[Piece]:
    """Cut a wall into pieces where it cannot be continuous.

    A piece ends at a gap between reflection points

    - that is longer than ``max_gap``,
    - that a leg or a direct path passes through below the higher of the two points, or
    - that is longer than `SOLID_GAP` and within which more links than by chance should have received a reflection and
      did not (`fewest_missed`).

    Each piece reaches beyond its outermost reflection points by their Fresnel zones, but not into a passage.

    Parameters
    ----------
    wall : Wall
    max_gap : float
        [m].
    legs : Legs, optional
        Legs known to be unobstructed.
    missed : array (n,), optional
        Places along the wall of reflections that were expected and not received [m].

    Returns
    -------
    list of Piece
        Beyond its ends a piece may go on unseen as far as the place by which as many links missed it as show an opening
        (`fewest_missed`), or the next piece.
    """
    along = wall.line.along(wall.reflection_points)
    order = np.argsort(along, kind="stable")
    along, height = along[order], wall.reflection_points[order, 2]
    gap = np.diff(along)
    ends = gap > max_gap
    passages = np.empty(0)
    if legs is not None:
        crosses, crossing = _crossings(wall.line, legs)
        place, up = wall.line.along(crossing[crosses]), crossing[crosses, 2]
        between = np.searchsorted(along, place)
        inside = (between > 0) & (between < len(along))
        left = between[inside] - 1
        below = up[inside] < np.maximum(height[left], height[left + 1])
        ends[left[below]] = True
        near = np.clip(between, 0, len(along) - 1)
        passages = place[up < np.maximum(height[near], height[np.maximum(near - 1, 0)])]
    missed = np.empty(0) if missed is None else np.sort(missed)
    between = np.searchsorted(along, missed)
    count = np.bincount(between[(between > 0) & (between < len(along))] - 1, minlength=len(gap))
    fewest = fewest_missed(len(along), int(count[gap <= SOLID_GAP].sum()))
    ends |= (gap > SOLID_GAP) & (count >= fewest)
    margin = fresnel_margin(wall)[order]
    pieces = []
    for run in np.split(np.arange(len(along)), np.flatnonzero(ends) + 1):
        low, high = along[run[0]], along[run[-1]]
        below_low, above_high = passages[passages < low], passages[passages > high]
        low_end = max(low - margin[run[0]], (low + below_low.max()) / 2 if len(below_low) else -np.inf)
        high_end = min(high + margin[run[-1]], (high + above_high.min()) / 2 if len(above_high) else np.inf)
        before, after = missed[missed < low], missed[missed > high]
        stops_low = [*before[::-1][fewest - 1 : fewest], *along[run[0] - 1 : run[0]]]
        stops_high = [*after[fewest - 1 : fewest], *along[run[-1] + 1 : run[-1] + 2]]
        unseen = np.array([low_end - max(stops_low, default=np.nan), min(stops_high, default=np.nan) - high_end])
        pieces.append(Piece(order[run], float(low_end), float(high_end), np.maximum(unseen, 0.0)))
    return pieces


def fewest_missed(received: int, missed: int) -> int:
    """Fewest links that miss a reflection side by side and so show an opening.

    Where a wall stands, ``received`` links of ``n = received + missed`` see it: between the panes of a facade with
    relief some have no specular point. If every share of such links is equally likely beforehand, ``k`` more are missed
    in a row with the probability ``B(received + 1, missed + k + 1) / B(received + 1, missed + 1)``. Any of the ``n``
    may be the first of such a row.

    Examples
    --------
    >>> fewest_missed(received=30, missed=0), fewest_missed(received=27, missed=5)
    (3, 5)
    """
    more = np.arange(1, 2 + received + missed)
    log_chance = betaln(received + 1, missed + more + 1) - betaln(received + 1, missed + 1)
    shown = np.log(received + missed) + log_chance < -TWENTY_TO_ONE
    return int(more[np.argmax(shown)]) if shown.any() else len(more) + 1


def footprint(wall: Wall, pieces: list[Piece]) -> Footprint:
    """Footprint of a wall's pieces."""
    top = [wall.reflection_points[piece.inliers, 2].max() for piece in pieces]
    low, high = [piece.low for piece in pieces], [piece.high for piece in pieces]
    return Footprint(wall.line, np.array(low), np.array(high), np.array(top))


def solid_footprint(wall: Wall) -> Footprint:
    """Footprint of a wall where its own reflection points show that it stands, without gaps over `SOLID_GAP`."""
    return footprint(wall, cut_wall(wall, SOLID_GAP))


def expected_reflections(line: Line, tx: FloatArray, rx: FloatArray) -> tuple[IntArray, FloatArray]:
    """Antenna pairs (pair,) in front of a line, and where along it (pair,) it would reflect their paths [m]."""
    far, near = line.signed_distance(tx), line.signed_distance(rx)
    front = np.flatnonzero((far > CLEARANCE) & (near > CLEARANCE))
    share = near[front] / (far[front] + near[front])
    of_rx, of_tx = line.along(rx[front]), line.along(tx[front])
    return front, of_rx + share * (of_tx - of_rx)


def piece_ends(wall: Wall, piece: Piece) -> FloatArray:
    """End points (2, 2) of a piece [m]."""
    return wall.line.foot() + np.array([[piece.low], [piece.high]]) * wall.line.direction()


def _crossings(line: Line, legs: Legs) -> tuple[BoolArray, FloatArray]:
    """Whether legs (leg,) cross a line, and where (leg, 3) [m]."""
    start, end = line.signed_distance(legs.start), line.signed_distance(legs.end)
    crosses = (np.minimum(start, end) < -CLEARANCE) & (np.maximum(start, end) > CLEARANCE)
    share = np.where(crosses, start, 0.0) / np.where(crosses, start - end, 1.0)
    return crosses, legs.start + share[:, None] * (legs.end - legs.start)
