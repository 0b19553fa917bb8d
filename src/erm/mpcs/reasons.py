"""Why an MPC is on a map or is not: a value for programs, and a text for people."""

from collections.abc import Iterable
from enum import StrEnum

import numpy as np


class Reason(StrEnum):
    """Result of selection and reconstruction for one MPC.

    The value is what the column ``reason`` of a table holds; `text` is for people and may change.

    Examples
    --------
    >>> Reason("direct_path").text
    'direct path'
    >>> Reason.ACCEPTED == "accepted"
    True
    """

    text: str

    def __new__(cls, value: str, text: str = "") -> "Reason":
        """Make a member of a value and its text."""
        member = str.__new__(cls, value)
        member._value_ = value
        member.text = text
        return member

    # set by `erm.mpcs.selection.select`; the first one that holds
    ACCEPTED = "accepted", "accepted"
    DIRECT_PATH = "direct_path", "direct path"
    NOT_STRONGEST = "not_strongest", "not the strongest MPC of its cluster"
    TOO_SHORT = "too_short", "not longer than the direct path"
    GROUND_REFLECTION = "ground_reflection", "ground reflection"
    ABOVE_FREE_SPACE = "above_free_space", "stronger than free space"
    LOSS = "loss", "reflection loss above the threshold"
    ELEVATION = "elevation", "elevation inconsistent with a vertical wall"
    DEPARTURE = "departure", "departure inconsistent with a single reflection"
    UNCERTAIN = "uncertain", "errors so large that it agrees with any wall"
    # set by `erm.reconstruction.reconstruct`
    NOT_SHARED = "not_shared", "no wall shared with other positions"
    CURVED_FACE = "curved_face", "off a curved face that walls hide"
    FALSE_ALARM = "false_alarm", "no more paths agree on its wall than by chance"
    MULTIPLE_REFLECTION = "multiple_reflection", "reflected more than once, off other walls"
    OBSTRUCTION = "obstruction", "its wall would block other paths"
    MEAN_ELEVATION = "mean_elevation", "mean elevation inconsistent with a vertical wall"
    IMPLAUSIBLE = "implausible", "multiple reflection more likely than a wall"


OF_RECONSTRUCTION = tuple(Reason)[tuple(Reason).index(Reason.NOT_SHARED) :]
"""Reasons of MPCs that may be single reflections, each alone."""


def count_reasons(reasons: Iterable[str]) -> dict[Reason, int]:
    """Number of MPCs of each reason, the most frequent first.

    Parameters
    ----------
    reasons : iterable of str
        Values of the column ``reason``.

    Examples
    --------
    >>> counts = count_reasons(["accepted", "direct_path", "accepted"])
    >>> [(reason.text, count) for reason, count in counts.items()]
    [('accepted', 2), ('direct path', 1)]
    """
    values, counts = np.unique(np.asarray(list(reasons), dtype=np.str_), return_counts=True)
    found = {Reason(value): count for value, count in zip(values.tolist(), counts.tolist(), strict=True)}
    return dict(sorted(found.items(), key=lambda item: (-item[1], item[0].text)))
