"""Which of the common images are walls: the plausible are believed first, and what contradicts them is not."""

from collections.abc import Sequence
from itertools import compress
from typing import NamedTuple

import numpy as np

from erm.geometry.vertical import angle_difference
from erm.mpcs.reasons import Reason
from erm.mpcs.selection import CONSISTENT_LOSS
from erm.reconstruction.decision.conflicts import Conflicts
from erm.reconstruction.decision.corners import corners_on
from erm.reconstruction.decision.multi_bounce import composed_of, mirror_of, orders_of_hidden_walls
from erm.reconstruction.decision.pieces import Links, pieces_of
from erm.reconstruction.model.extent import ASTRAY, Legs, Stretch
from erm.reconstruction.model.fit import fit_line, misfit
from erm.reconstruction.model.loss import SCATTER, loss_at_normal_incidence, loss_error, typical_loss, weighted_quantile
from erm.reconstruction.model.paths import BoolArray, IntArray
from erm.reconstruction.model.wall import Wall
from erm.reconstruction.search.false_alarm import accidental, odds_against_chance
from erm.reconstruction.search.images import GATE

TWIN_OFFSET = 0.02  # m; lines nearer than this, or than their errors, are one
TWIN_ANGLE = 0.2  # degree
CUTS = 2  # free paths through a wall that refute it; one may be a path taken for what it is not
ROUNDS = 4  # of believing and doubting; two are the rule

# Log odds of a common image to be a wall and not a chain off walls that nobody saw alone; see `plausibility`.
PRIOR = 1.7
PER_DECIBEL = -0.5  # of loss, face on, above that of the place
BETWEEN = 4.0  # dB; the loss above that of the place that walls and chains have alike
SPREAD = 3.5  # dB; of the losses of either about their mean
PER_RECEIVER_SHADOW = -2.8
PER_TRANSMITTER_SHADOW = -0.4
PER_DOUBLING = 0.7  # of the support beyond three
PER_DEGREE = 0.14  # between the smallest and the largest angle of incidence
MOST_DEGREES = 30.0
PER_ARRIVAL = -1.0  # each doubling of the place among the reflections of a link
LEAST_EXCESS = -1.0  # dB; that a face is metal proves nothing, two of metal and stone lose no more than stone
USUAL_LOSS = (8.5, 13.0)  # dB; concrete to plaster: of a place that tells nothing better

LEAST_ODDS = 2.0  # of a candidate whose paths are too weak for a wall but for their errors; six in seven are none
VAGUE = 0.3  # m; a line less certain than this agrees with anything
STEEP = 3.0  # degree; a scan of few elevations is biased by 2 degrees beyond its edges, all paths alike


class Verdict(NamedTuple):
    """Walls, their pieces, and what became of the other candidates."""

    walls: list[Wall]
    pieces: list[list[Stretch]]
    rejected: list[tuple[Wall, Reason]]


class Trial:
    """Candidates and all that speaks for and against them.

    Parameters
    ----------
    walls : sequence of Wall
        Candidates.
    witnesses : sequence of Wall
        Lines that too few paths share to be walls; chains may have bounced off them.
    sight : Legs
        Direct paths known to be free.
    max_gap : float
        [m].
    """

    def __init__(self, walls: Sequence[Wall], witnesses: Sequence[Wall], sight: Legs, max_gap: float) -> None:
        self.walls = list(walls)
        self._composed: dict[tuple[int, bytes], bool] = {}
        self.mirrors = [mirror_of(wall, max_gap) for wall in walls]
        certain = [w for w in witnesses if np.sqrt(w.line.covariance[1, 1]) < VAGUE and _turn_error(w) < VAGUE]
        self.witnesses = [mirror_of(wall, max_gap) for wall in certain]
        self.loss = np.array([loss_at_normal_incidence(wall) for wall in walls])
        self.support = support = np.array([wall.support for wall in walls], dtype=np.int64)
        self.betrayed_by: list[set[int]] = [set() for _ in walls]
        for one, other, known in orders_of_hidden_walls(walls):
            self.betrayed_by[one].add(known)
            self.betrayed_by[other].add(known)
        for one, known in corners_on(walls):
            self.betrayed_by[one].add(known)
        self.loss_error = np.array([loss_error(wall) for wall in walls])
        sure = support / (self.loss_error**2 + SCATTER**2)
        usual = weighted_quantile(self.loss, sure, 0.1) if len(walls) else 0.0
        self.usual_loss = float(np.clip(usual, *USUAL_LOSS))
        self.angles = [float(np.ptp(np.rad2deg(np.arccos(wall.incidence)))) for wall in walls]
        self.arrival = _arrivals(walls)
        self.weak = [bool(np.mean(wall.paths.loss > CONSISTENT_LOSS) > 0.5) for wall in walls]
        self.against_chance = odds_against_chance(self.walls, self.weak)
        merit = [self.merit(i) for i in range(len(walls))]
        alone = [-round(value, 6) for value in merit]
        # what others believed add to the merit is never positive
        self.conflicts = Conflicts(walls, sight, np.array(merit, dtype=float) >= 0)
        loss = [round(typical_loss(wall), 6) for wall in walls]
        self.order = sorted(range(len(walls)), key=lambda i: (alone[i], loss[i], -support[i]))
        self.rank = np.argsort(np.array(self.order, dtype=np.int64))

    def doubt(self, wall: int, believed: BoolArray) -> Reason | None:
        """Why a candidate is not to be believed beside others, if it is not.

        What stands in the way of what is decided by which of the two has more to be said for it.
        """
        if self.weak[wall] and self.against_chance[wall] < LEAST_ODDS:
            return Reason.CHANCE
        mean, error = self.walls[wall].rise
        if np.isfinite(error) and abs(mean) > STEEP + 3 * error:
            return Reason.MEAN_ELEVATION
        others = believed.copy()
        others[wall] = False
        stronger = others & (self.rank < self.rank[wall])
        if self.conflicts.blocked(wall, stronger) > 0.5 or self._is_cut(wall, stronger):
            return Reason.OBSTRUCTION
        if any(stronger[known] for known in self.betrayed_by[wall]):
            return Reason.MULTIPLE_REFLECTION
        if self.plausibility(wall, stronger) < 0:
            return Reason.IMPLAUSIBLE
        mirrors = [self.mirrors[i] for i in np.flatnonzero(others)] + self.witnesses
        key = (wall, others.tobytes())
        if key not in self._composed:
            self._composed[key] = composed_of(self.walls[wall], mirrors)
        return Reason.MULTIPLE_REFLECTION if self._composed[key] else None

    def _is_cut(self, wall: int, believed: BoolArray) -> bool:
        return self.conflicts.cuts(wall, believed) >= max(CUTS, ASTRAY * self.conflicts.support[wall])

    def plausibility(self, wall: int, believed: BoolArray) -> float:
        """Log odds of a candidate that no single test refutes: its merit, less if believed ones may hide it.

        Behind its last wall a chain of bounces points to where that wall, if it goes on a little beyond where it was
        seen, hides it.
        """
        first, second = self.conflicts.shadow(wall, believed)
        return self.merit(wall) + PER_TRANSMITTER_SHADOW * first + PER_RECEIVER_SHADOW * second

    def merit(self, wall: int) -> float:
        """Log odds of a candidate by itself.

        A chain of bounces loses more than a wall; it is seen from fewer places and, through the windows that its
        walls are to one another, over fewer angles; and it arrives after the paths off its walls. The weights are
        those of a logistic regression on random streets and rooms traced to three bounces, rounded.
        """
        excess = max(float(self.loss[wall]) - self.usual_loss, LEAST_EXCESS)
        # of two Gaussians that the error widens the log odds fall to this share
        told = SPREAD**2 / (SPREAD**2 + self.loss_error[wall] ** 2)
        return (
            PRIOR
            + PER_DECIBEL * (BETWEEN + told * (excess - BETWEEN))
            + PER_DOUBLING * float(np.log2(max(self.support[wall], 3) / 3))
            + PER_DEGREE * min(self.angles[wall], MOST_DEGREES)
            + PER_ARRIVAL * self.arrival[wall]
        )


def decide(candidates: Sequence[Wall], witnesses: Sequence[Wall], sight: Legs, links: Links, max_gap: float) -> Verdict:
    """Tell walls from chains of bounces.

    Candidates are believed in the order of what speaks for them by themselves. Each is held against those believed
    already, again and again until nothing changes.

    Parameters
    ----------
    candidates, witnesses : sequence of Wall
        Lines that enough and too few paths share.
    sight : Legs
        Direct paths known to be free.
    links : Links
        All antenna pairs.
    max_gap : float
        Reflection points on one line further apart are ends of different walls [m].
    """
    by_chance = accidental(candidates)
    accidents = [(wall, Reason.CHANCE) for wall in compress(candidates, by_chance)]
    trial = Trial(_without_twins(list(compress(candidates, ~by_chance)), max_gap), witnesses, sight, max_gap)
    walls = trial.walls
    believed = np.zeros(len(walls), dtype=bool)
    for _ in range(ROUNDS):
        before = believed.copy()
        for i in trial.order:
            believed[i] = trial.doubt(i, believed) is None
        if np.array_equal(before, believed):
            break
    rejected = [(walls[i], trial.doubt(i, believed) or Reason.OBSTRUCTION) for i in np.flatnonzero(~believed).tolist()]
    chosen = sorted(np.flatnonzero(believed).tolist(), key=lambda i: (-walls[i].support, trial.rank[i]))
    kept = [walls[i] for i in chosen]
    return Verdict(kept, pieces_of(kept, sight, links, max_gap), rejected + accidents)


def _turn_error(wall: Wall) -> float:
    """How far the error of a wall's direction moves the image of its first transmitter [m]."""
    away = abs(float(wall.line.depth(wall.paths.tx[0])))
    return float(np.deg2rad(np.sqrt(wall.line.covariance[0, 0]))) * 2 * away


def _arrivals(walls: Sequence[Wall]) -> list[float]:
    """How late (wall,) the paths of each candidate arrive among all reflections of their links.

    The mean over its paths of ``log2(1 + number of earlier ones)``.
    """
    if not walls:
        return []
    paths = walls[0].all_paths
    order = np.lexsort((np.round(paths.length, 6), paths.link))
    first = np.searchsorted(paths.link[order], paths.link)
    counted = np.r_[0, np.cumsum(paths.loss[order] <= CONSISTENT_LOSS)]  # ghosts of others are weak
    earlier = np.empty(len(paths), dtype=np.int64)
    earlier[order] = counted[:-1]
    place = np.log2(1 + earlier - counted[first])
    return [float(place[wall.members].mean()) for wall in walls]


def _without_twins(candidates: Sequence[Wall], max_gap: float) -> list[Wall]:
    """Candidates, those that are one line joined."""
    ranked = sorted(candidates, key=lambda wall: (-wall.support, round(typical_loss(wall), 6)))
    kept: list[Wall] = []
    normals = np.array([wall.line.normal for wall in ranked])
    middles = np.array([np.median(wall.points[:, :2], axis=0) for wall in ranked]).reshape(-1, 2)
    place: list[int] = []
    for number, wall in enumerate(ranked):
        turned = np.abs(angle_difference(normals[place], wall.line.normal))
        off = np.abs(wall.line.depth(middles[place])) if place else np.empty(0)
        near = np.flatnonzero((turned < 10) & (off < 2.0))
        twin = next((int(i) for i in near if _are_twins(kept[i], wall, max_gap)), None)
        if twin is None:
            kept.append(wall)
            place.append(number)
        else:
            kept[twin] = _joined(kept[twin], wall)
    return kept


def _are_twins(wall: Wall, other: Wall, max_gap: float) -> bool:
    """Whether two lines beside each other are one within their errors, or nearly so."""
    along, theirs = wall.line.along(wall.points), wall.line.along(other.points)
    if theirs.min() > along.max() + max_gap or theirs.max() < along.min() - max_gap:
        return False
    here, there = wall.line.about(other.line.pivot), other.line
    turned = abs(float(angle_difference(there.normal, here.normal)))
    # those one after the other may be the faces of a facade that bends
    beside = theirs.min() < along.max() and theirs.max() > along.min()
    if beside and turned < TWIN_ANGLE and abs(there.offset - here.offset) < TWIN_OFFSET:
        return True
    return float(np.mean(misfit(other.paths, wall.line) < GATE)) > 0.5


def _joined(wall: Wall, other: Wall) -> Wall:
    """Return the wall with the other's paths from links that it has none of, fitted again."""
    fresh = other.members[~np.isin(other.paths.link, wall.paths.link)]
    members: IntArray = np.sort(np.r_[wall.members, fresh])
    return Wall(wall.all_paths, fit_line(wall.all_paths.take(members), wall.line), members)
