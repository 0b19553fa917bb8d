"""Texts that the summaries of recordings and of products share."""

import numpy as np
from numpy.typing import ArrayLike

Lines = list[tuple[str, str]]
"""Labels and texts."""


def line_of_sight(los: int) -> str:
    """Write 1, 0 or -1 as yes, no or not known."""
    return {1: "yes", 0: "no"}.get(los, "not known")


def metres(position: ArrayLike) -> str:
    """Write a position (3,) [m]."""
    return ", ".join(f"{value:z.2f}" for value in np.asarray(position)) + " m"
