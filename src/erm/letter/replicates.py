"""What repeating an experiment says of its scatter: means and their standard errors."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from erm.geometry.vertical import FloatArray

CLEAR = 2.0  # standard errors; a difference of fewer is scatter


def mean(values: npt.ArrayLike) -> float:
    """Mean of what replicates gave; of those that gave something."""
    known = _known(values)
    return float(known.mean()) if known.size else float("nan")


def standard_error(values: npt.ArrayLike) -> float:
    """Standard error of the mean, ``s / sqrt(n)``; NaN of fewer than two values."""
    known = _known(values)
    return float(known.std(ddof=1) / np.sqrt(known.size)) if known.size > 1 else float("nan")


def with_error(values: npt.ArrayLike, *, percent: bool = False) -> str:
    """Mean and standard error in words, to two digits of the error's order."""
    middle, error = mean(values), standard_error(values)
    if not np.isfinite(middle):
        return "–"
    if percent:
        return f"{100 * middle:.0f} %" + (f" ± {100 * error:.0f}" if np.isfinite(error) else "")
    return f"{middle:.2g}" + (f" ± {error:.1g}" if np.isfinite(error) else "")


def difference(later: npt.ArrayLike, former: npt.ArrayLike) -> tuple[float, float]:
    """Mean difference of paired replicates and its standard error.

    The replicates of two settings stand at the same places, so that what the places do to both falls out.
    """
    apart = np.asarray(later, dtype=float) - np.asarray(former, dtype=float)
    return mean(apart), standard_error(apart)


def is_clear(step: tuple[float, float]) -> bool:
    """Whether a difference exceeds `CLEAR` of its standard errors."""
    return bool(abs(step[0]) > CLEAR * step[1])


def columns(rows: Sequence[Sequence[object]], field: str) -> FloatArray:
    """One field (value, replicate) of outcomes in rows of replicates."""
    return np.array([[getattr(one, field) for one in row] for row in rows], dtype=float)


def _known(values: npt.ArrayLike) -> FloatArray:
    values = np.asarray(values, dtype=float)
    return values[np.isfinite(values)]
