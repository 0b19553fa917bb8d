"""A chain that was accepted first gives way to the wall that explains it."""

import numpy as np
import pytest

from erm.mpcs.reasons import Reason
from erm.reconstruction.decision.decide import Candidates


class Rivals(Candidates):
    """Candidate 1 is obstructed by 0; 0 is a chain off 1 and 2 where both stand."""

    def __init__(self, explained_by: set[int], log_odds: float) -> None:
        self.explained_by, self.of_wall, self.order = explained_by, log_odds, [0, 1, 2]
        self._conflicts = self

    def rivals(self, wall, accepted):
        return [0] if accepted[0] and wall == 1 else []

    def log_odds(self, wall):
        return self.of_wall if wall == 1 else 5.0

    def reason_against(self, wall, accepted):
        if wall == 1:
            return Reason.OBSTRUCTION if accepted[0] else None
        explained = self.explained_by <= set(np.flatnonzero(accepted).tolist())
        return Reason.MULTIPLE_REFLECTION if wall == 0 and explained else None


@pytest.mark.parametrize(
    ("explained_by", "log_odds", "expected"),
    [({1, 2}, 1.0, [False, True, True]), ({1, 3}, 1.0, [True, False, True]), ({1, 2}, -1.0, [True, False, True])],
)
def test_a_wall_replaces_what_it_explains_and_nothing_else(explained_by, log_odds, expected):
    accepted = np.array([True, False, True])
    changed = Rivals(explained_by, log_odds).exchange(accepted)
    assert accepted.tolist() == expected
    assert changed == (not expected[0])
