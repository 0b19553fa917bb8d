"""Decide which common images are walls.

The most plausible candidates are accepted first. Candidates that contradict accepted ones are rejected.
"""

from collections.abc import Callable, Sequence
from itertools import compress, pairwise
from typing import NamedTuple

import numpy as np
import shapely

from erm.common.odds import TWENTY_TO_ONE
from erm.mpcs.reasons import Reason
from erm.mpcs.selection import ELEVATION_STD
from erm.reconstruction.decision.conflicts import Conflicts
from erm.reconstruction.decision.corners import corner_pairs
from erm.reconstruction.decision.duplicates import merge_duplicates
from erm.reconstruction.decision.multi_bounce import (
    MAX_MIRROR_ERROR,
    hidden_wall_pairs,
    image_spread,
    is_multi_bounce,
    mirror_of,
)
from erm.reconstruction.decision.pieces import Links, cut_walls, plan_lines
from erm.reconstruction.model.extent import MAX_TESTED_PATHS, STRAY_SHARE, Legs, Piece, legs_of
from erm.reconstruction.model.line import Lines
from erm.reconstruction.model.loss import (
    LOSS_SCATTER,
    excess_loss,
    loss_at_normal_incidence,
    loss_error,
    median_loss,
    weighted_quantile,
)
from erm.reconstruction.model.paths import BoolArray, IntArray, Paths
from erm.reconstruction.model.ragged import Ragged
from erm.reconstruction.model.wall import Wall
from erm.reconstruction.search.false_alarm import evidence, without_worthless

MAX_ROUNDS = 4
"""Repetitions of the decision; two are usual. Chosen; not derived."""

# Coefficients of the log odds of a common image to be a wall and not a chain off walls that were not seen alone: a
# logistic regression on 23 random streets and rooms traced to three bounces, with 12 to 400 positions, rounded; see
# `Candidates.log_odds`. The intercept was then raised by 0.6, by hand, for the random city of benchmarks/map_scale.py:
# the regression is not kept, and should be repeated on more worlds. The number of paths is no evidence: a chain has as
# many more in a larger campaign as a wall.
INTERCEPT = 3.4
PER_DECIBEL = -1.0
"""Per dB of loss above that of a typical wall of the scene at the same angles."""
PER_RECEIVER_SHADOW = -2.6
"""For receivers' legs that are obstructed for certain."""
PER_DEGREE = 0.29
"""Per degree of the range of angles of incidence."""
PER_DOUBLED_ARRIVAL = -1.6
"""Per doubling of the position among the reflections of a link, in the order of their delays."""
PER_OPENING = -1.6
"""For each opening that the candidate, or an accepted wall in front of it, must have."""
NEUTRAL_EXCESS_LOSS = 4.0
"""Loss above that of the scene that walls and chains have equally often [dB]; from the same experiment."""
EXCESS_LOSS_SCATTER = 3.5
"""Standard deviation of the losses of either about their mean [dB]; from the same experiment."""
MAX_ANGLE_RANGE = 30.0
"""Range of angles of incidence above which more is no further evidence [degree]. Chosen; not derived."""
SCENE_LOSS_RANGE = (8.5, 13.0)
"""Limits of the loss of a scene at normal incidence [dB]: concrete and plaster."""


class KnownCurved(NamedTuple):
    """Curved faces, which are found before walls are decided."""

    standing: np.ndarray
    """Geometries (face,) of shapely: where they stand, seen from above."""
    explain: Callable[[Paths, Lines], tuple[IntArray, IntArray]]
    """Pairs of paths and walls, of which chains off one of them and the wall explain the path."""


class Decision(NamedTuple):
    """Walls, their pieces, and the rejected candidates with the reasons."""

    walls: list[Wall]
    pieces: list[list[Piece]]
    rejected: list[tuple[Wall, Reason]]


class Candidates:
    """Candidates and all that speaks for and against them.

    Parameters
    ----------
    walls : sequence of Wall
        Candidates.
    minor : sequence of Wall
        Lines that too few links share to be walls. Chains may have been reflected off them.
    lines_of_sight : Legs
        Direct paths known to be unobstructed.
    max_gap : float
        [m].
    curved : KnownCurved
    """

    def __init__(
        self, walls: Sequence[Wall], minor: Sequence[Wall], lines_of_sight: Legs, max_gap: float, curved: KnownCurved
    ) -> None:
        self.walls = list(walls)
        self._off_curved = _chains_off_curved(walls, curved)
        tree = shapely.STRtree(curved.standing)
        self._curved_openings = [_openings_of_curved(wall, tree) for wall in walls]
        self._is_multi_bounce: dict[tuple[int, bytes], bool] = {}
        self._mirrors = [mirror_of(wall, max_gap) for wall in walls]
        self._minor_mirrors = [mirror_of(wall, max_gap) for wall in minor if _is_certain(wall)]
        loss = np.array([loss_at_normal_incidence(wall) for wall in walls])
        support = np.array([wall.support for wall in walls], dtype=np.int64)
        self._explained_by: list[set[int]] = [set() for _ in walls]
        for one, other, known in hidden_wall_pairs(walls):
            self._explained_by[one].add(known)
            self._explained_by[other].add(known)
        for one, known in corner_pairs(walls):
            self._explained_by[one].add(known)
        self._loss_error = np.array([loss_error(wall) for wall in walls])
        weight = support / (self._loss_error**2 + LOSS_SCATTER**2)
        scene_loss = weighted_quantile(loss, weight, 0.1) if len(walls) else 0.0
        typical = float(np.clip(scene_loss, *SCENE_LOSS_RANGE))
        self._excess = [excess_loss(wall, typical) for wall in walls]
        self._angle_range = [_angle_range(wall) for wall in walls]
        self._arrival = _arrivals(walls)
        self._elevation = [_log_odds_of_elevation(wall) for wall in walls]
        alone = [self.log_odds(i) for i in range(len(walls))]
        # obstruction by others never raises the log odds, so candidates below 0 alone stay below
        self._conflicts = Conflicts(walls, lines_of_sight, np.array(alone, dtype=float) >= 0)
        median = [round(median_loss(wall), 6) for wall in walls]
        self.order = sorted(range(len(walls)), key=lambda i: (-round(alone[i], 6), median[i], -support[i]))
        self.rank = np.argsort(np.array(self.order, dtype=np.int64))

    def reason_against(self, wall: int, accepted: BoolArray) -> Reason | None:
        """Why a candidate cannot be accepted beside others (candidate,); None if it can.

        Of two candidates that obstruct each other the one with the higher log odds is kept.
        """
        others = accepted.copy()
        others[wall] = False
        stronger = others & (self.rank < self.rank[wall])
        if any(stronger[known] for known in self._explained_by[wall]):
            return Reason.MULTIPLE_REFLECTION
        log_odds = self._log_odds_beside(wall, stronger)
        if log_odds < 0:
            return Reason.IMPLAUSIBLE if log_odds < self._elevation[wall] else Reason.MEAN_ELEVATION
        if log_odds + PER_OPENING * (self._conflicts.openings(wall, stronger) + self._curved_openings[wall]) < 0:
            return Reason.OBSTRUCTION
        key = (wall, others.tobytes())
        if key not in self._is_multi_bounce:
            mirrors = [self._mirrors[i] for i in np.flatnonzero(others)] + self._minor_mirrors
            self._is_multi_bounce[key] = is_multi_bounce(self.walls[wall], mirrors)
        path, known = self._off_curved[wall]
        of_curved = 2 * len(np.unique(path[others[known]])) > self.walls[wall].support
        return Reason.MULTIPLE_REFLECTION if of_curved or self._is_multi_bounce[key] else None

    def exchange(self, accepted: BoolArray) -> bool:
        """Accept a candidate in place of one that it obstructs and explains; whether there is one.

        A chain off two walls that is plausible alone is accepted before the weaker of them, and then obstructs it.
        """
        for wall in self.order:
            if accepted[wall] or self.log_odds(wall) < 0:
                continue
            for rival in self._conflicts.rivals(wall, accepted):
                trial = accepted.copy()
                trial[wall], trial[rival] = True, False
                if self.reason_against(wall, trial) is None and (
                    self.reason_against(rival, trial) is Reason.MULTIPLE_REFLECTION
                ):
                    accepted[:] = trial
                    return True
        return False

    def _log_odds_beside(self, wall: int, accepted: BoolArray) -> float:
        """`log_odds`, less if accepted candidates may obstruct the wall.

        The last wall of a chain, if it extends a little beyond its reflection points, obstructs the wall that the
        chain looks like.
        """
        return self.log_odds(wall) + PER_RECEIVER_SHADOW * self._conflicts.shadowing(wall, accepted)[1]

    def log_odds(self, wall: int) -> float:
        """Log odds of a candidate alone to be a wall and not a chain.

        A chain of reflections loses more than a wall. It is received in fewer places and over a smaller range of
        angles, for it must meet all of its walls, and it arrives after the paths off these walls. What loses less than
        the walls of the scene is no more a wall than these: its gains are wrong, as those of a path from below the
        fan that is taken to be off a vertical face. Chains off floors and ceilings arrive at other elevations.
        """
        # the log odds of two Gaussians of equal width fall by this factor if an error widens both
        factor = EXCESS_LOSS_SCATTER**2 / (EXCESS_LOSS_SCATTER**2 + self._loss_error[wall] ** 2)
        return (
            INTERCEPT
            + PER_DECIBEL * (NEUTRAL_EXCESS_LOSS + factor * (max(self._excess[wall], 0.0) - NEUTRAL_EXCESS_LOSS))
            + PER_DEGREE * min(self._angle_range[wall], MAX_ANGLE_RANGE)
            + PER_DOUBLED_ARRIVAL * self._arrival[wall]
            + self._elevation[wall]
        )


def decide_walls(
    candidates: Sequence[Wall],
    minor: Sequence[Wall],
    lines_of_sight: Legs,
    links: Links,
    max_gap: float,
    min_support: int,
    curved: KnownCurved,
) -> Decision:
    """Tell walls from chains of reflections.

    Candidates are accepted in the order of their log odds alone. Each is tested against those that are accepted
    already, again and again until nothing changes.

    Parameters
    ----------
    candidates, minor : sequence of Wall
        Lines that enough, and too few, links share.
    lines_of_sight : Legs
        Direct paths known to be unobstructed.
    links : Links
        All antenna pairs.
    max_gap : float
        Reflection points on one line further apart than this are on different walls [m].
    min_support : int
        Fewest paths on the pieces of a wall. A path far from the others may be off another wall and is no evidence.
    curved : KnownCurved
    """
    candidates = [wall for wall in without_worthless(candidates) if wall.support >= min_support]
    false_alarms = evidence(candidates) < TWENTY_TO_ONE
    rejected = [(wall, Reason.FALSE_ALARM) for wall in compress(candidates, false_alarms)]
    distinct = merge_duplicates(list(compress(candidates, ~false_alarms)), max_gap)
    ranked = Candidates(distinct, minor, lines_of_sight, max_gap, curved)
    walls = ranked.walls
    accepted = np.zeros(len(walls), dtype=bool)
    for _ in range(MAX_ROUNDS):
        before = accepted.copy()
        for i in ranked.order:
            accepted[i] = ranked.reason_against(i, accepted) is None
        if np.array_equal(before, accepted) and not ranked.exchange(accepted):
            break
    reasons = [
        (walls[i], ranked.reason_against(i, accepted) or Reason.OBSTRUCTION) for i in np.flatnonzero(~accepted).tolist()
    ]
    chosen = sorted(np.flatnonzero(accepted).tolist(), key=lambda i: (-walls[i].support, ranked.rank[i]))
    kept = [walls[i] for i in chosen]
    pieces = cut_walls(kept, lines_of_sight, links, max_gap, curved.standing)
    shared = [sum(len(piece.inliers) for piece in own) >= min_support for own in pieces]
    too_few = [(wall, Reason.NOT_SHARED) for wall, enough in zip(kept, shared, strict=True) if not enough]
    return Decision(list(compress(kept, shared)), list(compress(pieces, shared)), reasons + rejected + too_few)


def _openings_of_curved(wall: Wall, curved: shapely.STRtree) -> int:
    """Number of curved faces that a candidate's paths pass through, if more than half of the paths meet any."""
    wall = wall.thinned(MAX_TESTED_PATHS)
    leg, face = curved.query(plan_lines(*legs_of(wall)), predicate="intersects")
    met = len(np.unique(leg % wall.support))
    return len(np.unique(face)) if met > wall.support / 2 else 0


def _chains_off_curved(walls: Sequence[Wall], curved: KnownCurved) -> list[tuple[IntArray, IntArray]]:
    """Of each candidate the pairs of its paths and candidates, of which chains with a curved face explain the path."""
    if not walls:
        return []
    inliers = Ragged.from_lists([wall.inliers for wall in walls])
    row, known = curved.explain(walls[0].all_paths.take(inliers.rows), Lines.from_list([wall.line for wall in walls]))
    order = np.argsort(row, kind="stable")
    edges = np.searchsorted(row[order], inliers.start)
    return [(row[order[low:high]], known[order[low:high]]) for low, high in pairwise(edges.tolist())]


def _is_certain(wall: Wall) -> bool:
    """Whether the image of the transmitter in a line is known to `MAX_MIRROR_ERROR`."""
    return image_spread(wall.line, wall.paths.tx[0, :2]) < MAX_MIRROR_ERROR


def _angle_range(wall: Wall) -> float:
    """Range of the angles of incidence of all paths but one, or but `STRAY_SHARE` of many [degree].

    A stray may be anywhere along the line.
    """
    angle = np.sort(np.rad2deg(np.arccos(wall.cos_incidence)))
    strays = max(1, int(STRAY_SHARE * len(angle)))
    return float((angle[len(angle) - 1 - strays :] - angle[: strays + 1]).min())


def _log_odds_of_elevation(wall: Wall) -> float:
    """Log odds of the elevations to be those off a vertical wall and not off by a mean of their own, at most 0.

    Chains off vertical walls have the same elevations, those off floors and ceilings others, alike in all paths. A
    `STRAY_SHARE` of the paths has elevations that say nothing, as of two paths that were taken for one. The errors of
    elevations common to all paths are `ELEVATION_STD`.
    """
    paths = wall.thinned(MAX_TESTED_PATHS).paths
    known = np.isfinite(paths.elevation_excess)
    excess, std = paths.elevation_excess[known], paths.elevation_std[known]
    mean = np.append(excess, 0.0)
    kept = np.exp(-(((excess - mean[:, None]) / std) ** 2) / 2)
    log_likelihood = np.log((1 - STRAY_SHARE) * kept + STRAY_SHARE).sum(axis=1)
    return float((log_likelihood - (mean / ELEVATION_STD) ** 2 / 2).max() - log_likelihood.max())


def _arrivals(walls: Sequence[Wall]) -> list[float]:
    """How late (wall,) the paths of each candidate arrive among those of all candidates at their links.

    The mean over its paths of ``log2(1 + number of earlier ones)``.
    """
    if not walls:
        return []
    paths = walls[0].all_paths
    shared = np.zeros(len(paths), dtype=bool)  # the others may be artefacts
    for wall in walls:
        shared[wall.inliers] = True
    order = np.lexsort((np.round(paths.length, 6), paths.link))
    first = np.searchsorted(paths.link[order], paths.link)
    counted = np.r_[0, np.cumsum(shared[order])]
    earlier = np.empty(len(paths), dtype=np.int64)
    earlier[order] = counted[:-1]
    place = np.log2(1 + earlier - counted[first])
    return [float(place[wall.inliers].mean()) for wall in walls]
