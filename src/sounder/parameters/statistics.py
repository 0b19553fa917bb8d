"""What a paper prints of a campaign: medians, 10 and 90 %, moments, and fits of path loss, LoS and NLoS apart."""

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.special import bdtr

from sounder.parameters.catalogue import PARAMETERS
from sounder.parameters.path_loss import CONFIDENCE, Fit, close_in, floating_intercept

LINES_OF_SIGHT = {1: "LoS", 0: "NLoS", -1: "unknown"}
"""Names of groups of positions by their line of sight."""
QUANTILES = {"median": 0.5, "p10": 0.1, "p90": 0.9}
FITS = {
    "path_loss_close_in": "L = FSPL(f, 1 m) + 10 n lg(d / 1 m) + X; Sun et al. 2016",
    "path_loss_floating_intercept": "L = alpha + 10 beta lg(d / 1 m) + X, least squares; Sun et al. 2016",
}

Real = NDArray[np.float64]


@dataclass(frozen=True)
class Statistic:
    """One number of a campaign.

    Attributes
    ----------
    group : str
        ``LoS``, ``NLoS``, ``unknown`` or ``all``.
    parameter, statistic, unit : str
    value : float
    low, high : float
        Interval of :data:`sounder.parameters.path_loss.CONFIDENCE`; NaN where there is none.
    positions : int
        Positions that the number is of.
    definition : str
        Of the parameter, and of the paths that count.
    """

    group: str
    parameter: str
    statistic: str
    unit: str
    value: float
    low: float
    high: float
    positions: int
    definition: str


def campaign_statistics(parameters: xr.Dataset) -> list[Statistic]:
    """Compute the statistics of all parameters and the fits of path loss.

    Quantiles are interpolated linearly. Their confidence intervals are those of order statistics, which assume no
    distribution. Of logarithmic parameters (:data:`sounder.parameters.catalogue.PARAMETERS`) there are ``lg_mean`` and
    ``lg_std`` of the positive values in their unit, as in TR 38.901, Table 7.5-6.

    Parameters
    ----------
    parameters : xarray.Dataset
        Along ``position``, from :func:`sounder.channel_parameters`. Positions with ``doubts`` do not count.

    Returns
    -------
    list of Statistic
        Of the groups that have positions; ``all`` if there are several. Parameters without values are left out.

    Examples
    --------
    >>> columns = {"path_loss": [100.0, 110.0, 120.0], "distance": [10.0, 20.0, 40.0]}
    >>> table = xr.Dataset({name: ("position", values) for name, values in columns.items()})
    >>> table["los"], table["frequency"] = ("position", [1, 1, 1]), ("position", [132e9] * 3)
    >>> [f"{one.value:.0f} {one.unit}" for one in campaign_statistics(table) if one.statistic == "median"]
    ['110 dB']
    """
    if "doubts" in parameters:
        parameters = parameters.isel(position=np.flatnonzero(parameters["doubts"].values == ""))
    los = parameters["los"].values
    groups = {name: los == value for value, name in LINES_OF_SIGHT.items() if (los == value).any()}
    if len(groups) > 1:
        groups["all"] = np.ones(los.size, bool)
    selection = (
        "; ".join(dict.fromkeys(np.atleast_1d(parameters["definition"].values).tolist()))
        if ("definition" in parameters)
        else ""
    )
    result = []
    for group, members in groups.items():
        for name in PARAMETERS:
            if name in parameters:
                result += _of_parameter(group, name, parameters[name].values[members], selection)
        distance, loss, frequency = (
            parameters[name].values[members] for name in ("distance", "path_loss", "frequency")
        )
        fits = close_in(distance, loss, frequency), floating_intercept(distance, loss)
        for (name, definition), fit in zip(FITS.items(), fits, strict=True):
            result += _of_fit(group, name, fit, f"{definition}; {selection}")
    return result


def quantile(values: Real, share: float) -> tuple[float, float, float]:
    """Quantile of a sample, and its confidence interval from order statistics.

    Parameters
    ----------
    values : array (position,)
        May be infinite.
    share : float
        0 to 1.

    Returns
    -------
    value, low, high : float
        NaN where the sample is too small for the interval: for the median, under 6 values.

    Examples
    --------
    >>> print(*quantile(np.arange(11.0), 0.5))
    5.0 1.0 9.0
    """
    ordered = np.sort(values)
    place = share * (ordered.size - 1)
    below, part = int(place), place - int(place)
    value = float(ordered[below])
    if part and ordered[below + 1] != value:
        value += part * (float(ordered[below + 1]) - value)
    below_rank = bdtr(np.arange(ordered.size + 1), ordered.size, share)  # binomial distribution
    ranks = [int(np.searchsorted(below_rank, (1 + sign * CONFIDENCE) / 2)) for sign in (-1, 1)]
    if ranks[0] < 1 or ranks[1] + 1 > ordered.size:
        return value, float("nan"), float("nan")
    return value, float(ordered[ranks[0] - 1]), float(ordered[ranks[1]])


def _of_parameter(group: str, name: str, values: Real, selection: str) -> list[Statistic]:
    """Statistics of one parameter; none if it is known of no position."""
    about = PARAMETERS[name]
    definition = f"{about.definition}; {selection}"
    known = values[~np.isnan(values)].astype(float)
    if not known.size:
        return []

    def one(statistic: str, value: float, interval: tuple[float, float], count: int, unit: str) -> Statistic:
        return Statistic(group, name, statistic, unit, value, *interval, count, definition)

    unknown = (float("nan"), float("nan"))
    result = []
    for statistic, share in QUANTILES.items():
        value, *interval = quantile(known, share)
        result.append(one(statistic, value, (interval[0], interval[1]), known.size, about.unit))
    finite = known[np.isfinite(known)]
    samples = {"mean": (finite, about.unit)}
    if about.logarithmic:
        samples["lg_mean"] = (np.log10(finite[finite > 0]), f"lg {about.unit}")
    for statistic, (sample, unit) in samples.items():
        if sample.size:
            result.append(one(statistic, float(sample.mean()), unknown, sample.size, unit))
        if sample.size > 1:
            deviation = statistic.replace("mean", "std")
            result.append(one(deviation, float(sample.std(ddof=1)), unknown, sample.size, unit))
    return result


def _of_fit(group: str, name: str, fit: Fit, definition: str) -> list[Statistic]:
    """Numbers of a fit of path loss."""
    rows = {
        "intercept": (fit.intercept, fit.intercept_interval, "dB"),
        "exponent": (fit.exponent, fit.exponent_interval, "1"),
        "shadowing": (fit.shadowing, fit.shadowing_interval, "dB"),
    }
    return [
        Statistic(group, name, part, unit, value, *interval, fit.positions, definition)
        for part, (value, interval, unit) in rows.items()
        if np.isfinite(value)
    ]
