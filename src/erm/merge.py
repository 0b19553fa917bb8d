"""Walls from faces: paths off one vertical wall share the transmitter's mirror image, whatever the receiver.

Hypotheses grow from single faces; the best supported one takes its paths, and the rest compete again.
"""

from typing import NamedTuple

import numpy as np

from erm.geometry import FloatArray
from erm.wall import IntArray, Line, Paths, fit_line, misfit, seed_line

GATE = 13.8  # chi-squared of 2 degrees of freedom that one true path in a thousand exceeds


class Hypothesis(NamedTuple):
    """A line and the paths that agree with it, at most one a link."""

    line: Line
    members: IntArray
    score: float


def grow(paths: Paths, seed: int, start: Line | None = None) -> Hypothesis:
    """Let a face gather the paths that agree with it, refitting until the set no longer changes."""
    line = seed_line(paths.take(np.array([seed]))) if start is None else start
    members = np.array([seed])
    for _ in range(12):
        chi2 = misfit(paths, line)
        gathered = _best_of_each_link(chi2, paths.link)
        if len(gathered) == 0:
            return Hypothesis(line, gathered, 0.0)
        line = fit_line(paths.take(gathered), line)
        if np.array_equal(gathered, members):
            break
        members = gathered
    chi2 = misfit(paths, line)
    members = _best_of_each_link(chi2, paths.link)
    return Hypothesis(line, members, float(np.sum(1 - chi2[members] / GATE)))


def merge(paths: Paths, min_support: int) -> list[Hypothesis]:
    """Explain the paths by as few walls as needed, best supported first.

    Every path is the seed of a hypothesis. The best one takes its members; hypotheses that shared some of
    these grow again from what is left.

    Parameters
    ----------
    min_support : int
        Fewest links that make a wall.

    Returns
    -------
    list of Hypothesis
        Members index ``paths``.
    """
    # moving the scene or shuffling the rows leaves delays and gains alone, not coordinates and row numbers
    order = np.lexsort((paths.loss, paths.length))
    paths = paths.take(order)
    free = np.arange(len(paths))
    grown = {seed: grow(paths, seed) for seed in range(len(paths))}
    walls: list[Hypothesis] = []
    while grown:
        best = max(grown, key=lambda seed: (round(grown[seed].score, 6), -seed))
        wall = grown[best]
        if len(wall.members) < min_support:
            break
        walls.append(wall._replace(members=np.sort(order[wall.members])))
        free = np.setdiff1d(free, wall.members)
        taken = set(wall.members.tolist())
        left = paths.take(free)
        place = {int(path): i for i, path in enumerate(free)}
        for seed in list(grown):
            if seed in taken or seed not in place:
                del grown[seed]
            elif taken & set(grown[seed].members.tolist()):
                again = grow(left, place[seed])
                grown[seed] = again._replace(members=free[again.members])
    return walls


def _best_of_each_link(chi2: FloatArray, link: IntArray) -> IntArray:
    """Index of the best-fitting path of each link, of those inside the gate; ascending."""
    inside = np.flatnonzero(chi2 < GATE)
    inside = inside[np.lexsort((chi2[inside], link[inside]))]
    first = np.r_[True, link[inside][1:] != link[inside][:-1]][: len(inside)]
    return np.sort(inside[first])
