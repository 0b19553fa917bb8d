"""Scatter of repeated experiments: means and their standard errors."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from erm.geometry.vertical import FloatArray

SIGNIFICANT = 2.0  # standard errors; a smaller difference is scatter (about 95 % of a normal distribution)


def mean(values: npt.ArrayLike) -> float:
    """Mean over the replicates that gave a number."""
    known = _known(values)
    return float(known.mean()) if known.size else float("nan")


def standard_error(values: npt.ArrayLike) -> float:
    """Standard error of the mean, ``s / sqrt(n)``; NaN for fewer than two values."""
    known = _known(values)
    return float(known.std(ddof=1) / np.sqrt(known.size)) if known.size > 1 else float("nan")


def with_error(values: npt.ArrayLike, *, percent: bool = False) -> str:
    """Write the mean with two digits and its standard error with one."""
    middle, error = mean(values), standard_error(values)
    if not np.isfinite(middle):
        return "–"
    if percent:
        return f"{100 * middle:.0f} %" + (f" ± {100 * error:.0f}" if np.isfinite(error) else "")
    return f"{middle:.2g}" + (f" ± {error:.1g}" if np.isfinite(error) else "")


def difference(later: npt.ArrayLike, former: npt.ArrayLike) -> tuple[float, float]:
    """Mean difference of paired replicates and its standard error.

    The replicates of two settings have the same positions, so that effects of the positions cancel.
    """
    apart = np.asarray(later, dtype=float) - np.asarray(former, dtype=float)
    return mean(apart), standard_error(apart)


def is_significant(step: tuple[float, float]) -> bool:
    """Whether a difference exceeds `SIGNIFICANT` of its standard errors."""
    return bool(abs(step[0]) > SIGNIFICANT * step[1])


def columns(rows: Sequence[Sequence[object]], field: str) -> FloatArray:
    """Return one field (value, replicate) of outcomes in rows of replicates."""
    return np.array([[getattr(one, field) for one in row] for row in rows], dtype=float)


def _known(values: npt.ArrayLike) -> FloatArray:
    values = np.asarray(values, dtype=float)
    return values[np.isfinite(values)]
