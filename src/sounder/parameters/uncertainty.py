"""Standard deviations of parameters, propagated from those of the MPCs."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
import xarray as xr
from numpy.typing import NDArray

Real = NDArray[np.float64]
COLUMNS = ("delay", "azimuth", "elevation", "path_gain")


@dataclass(frozen=True)
class Paths:
    """Paths of a position as arrays, any of which may have leading dimensions.

    Attributes
    ----------
    delay, azimuth, elevation, path_gain : array (..., path)
        [s], [degree], [degree], [dB].
    """

    delay: Real
    azimuth: Real
    elevation: Real
    path_gain: Real

    @classmethod
    def of(cls, mpcs: xr.Dataset) -> Self:
        """Columns of a table of MPCs."""
        return cls(*(mpcs[name].values.astype(float) for name in COLUMNS))

    @property
    def power(self) -> Real:
        """Path gain (..., path), linear."""
        return np.asarray(10 ** (self.path_gain / 10))

    def moved(self, by: Real) -> "Paths":
        """Each path moved alone: (path, path), in row ``i`` path ``i`` by ``by[i]`` (path, 4)."""
        moved = (
            getattr(self, name) + np.diag(column)
            if column.any()
            else np.broadcast_to(getattr(self, name), (len(by),) * 2)
            for name, column in zip(COLUMNS, by.T, strict=True)
        )
        return Paths(*moved)


def standard_deviations(
    paths: Paths, mpcs: xr.Dataset, parameters: Callable[[Paths], dict[str, Real]]
) -> dict[str, float]:
    """Standard deviation of each parameter, by central differences over one standard deviation (delta method).

    ``var(f) = sum_k ((f(x + s_k) - f(x - s_k)) / 2)^2``. The ``s_k`` are the columns of a square root of the covariance
    ``C_i`` of each MPC, ``C_i = sum_k s_k s_k^T``; MPCs are independent. The part of the delays that the clock moves
    together (``clock_std``) is one more ``s_k``, which moves all. For linear ``f`` this is exact. Steps of one standard
    deviation, in place of a derivative, keep it right where ``f`` bends within them.

    The errors are those of the MPCs that were selected. What those do not know is not in them: paths under the
    threshold, the calibration of the gain, and errors of the positions. Where a parameter jumps, as the coherence
    bandwidth from one crossing of the correlation to another, it is the error between jumps.

    Parameters
    ----------
    paths : Paths
        Arrays (path,).
    mpcs : xarray.Dataset
        Their table; of it ``covariance`` (mpc, parameter, other) or else the columns ``_std``, and ``clock_std``.
    parameters : callable
        Parameters of paths (..., path) as arrays (...).

    Returns
    -------
    dict
        NaN where no standard deviation is known, or where the parameter is infinite nearby.

    Examples
    --------
    >>> columns = dict.fromkeys(COLUMNS, [0.0, 0.0]) | {"delay": [0.0, 1e-7], "delay_std": [0.0, 2e-9]}
    >>> mpcs = xr.Dataset({name: ("mpc", values) for name, values in columns.items()})
    >>> mean = lambda paths: {"mean": paths.delay.mean(axis=-1)}
    >>> print(f"{standard_deviations(Paths.of(mpcs), mpcs, mean)['mean']:.2g} s")
    1e-09 s
    """
    nominal = parameters(paths)
    steps, clock = _steps(mpcs)
    if steps is None:
        return dict.fromkeys(nominal, float("nan"))
    variance = dict.fromkeys(nominal, 0.0)
    for step in np.moveaxis(steps, -1, 0):
        if step.any():
            up, down = parameters(paths.moved(step)), parameters(paths.moved(-step))
            for name in variance:
                variance[name] += _squares(up[name], down[name])
    if clock.any():
        up, down = (parameters(replace(paths, delay=paths.delay + sign * clock)) for sign in (1, -1))
        for name in variance:
            variance[name] += _squares(up[name], down[name])
    return {name: float(np.sqrt(value)) for name, value in variance.items()}


def _squares(up: Real, down: Real) -> float:
    with np.errstate(invalid="ignore"):  # infinite on both sides: not known
        return float((((up - down) / 2) ** 2).sum())


def _steps(mpcs: xr.Dataset) -> tuple[Real | None, Real]:
    """Square roots (mpc, 4, 4) of the covariances, columns being steps, and the clock's part (mpc,) of the delays."""
    count = mpcs.sizes["mpc"]
    clock = np.nan_to_num(mpcs["clock_std"].values) if "clock_std" in mpcs else np.zeros(count)
    if "covariance" in mpcs:
        covariance = np.nan_to_num(mpcs["covariance"].values)
    else:
        known = [np.nan_to_num(mpcs[f"{name}_std"].values) if f"{name}_std" in mpcs else None for name in COLUMNS]
        if all(column is None or not column.any() for column in known):
            return None, clock
        std = np.stack([np.zeros(count) if column is None else column for column in known], axis=-1)
        covariance = std[:, :, None] * std[:, None, :] * np.eye(len(COLUMNS))
    covariance = covariance.copy()
    covariance[:, 0, 0] = np.maximum(covariance[:, 0, 0] - clock**2, 0)
    scale = np.sqrt(np.maximum(np.diagonal(covariance, axis1=1, axis2=2), np.finfo(float).tiny))
    correlation = covariance / scale[:, :, None] / scale[:, None, :]  # seconds and degrees differ by 10 orders
    value, vector = np.linalg.eigh(correlation)
    return scale[:, :, None] * vector * np.sqrt(np.maximum(value, 0))[:, None, :], clock
