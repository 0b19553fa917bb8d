"""All parameters of one position, with their standard deviations."""

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from erm.common.constants import SAME_DELAY, c
from sounder.options import Clustering
from sounder.parameters.angles import Spread, angular_spread
from sounder.parameters.catalogue import PARAMETERS
from sounder.parameters.clusters import cluster_spreads, find_clusters
from sounder.parameters.delay import (
    coherence_bandwidth,
    frequency_correlation,
    maximum_excess_delay,
    mean_excess_delay,
    rms_delay_spread,
)
from sounder.parameters.k_factor import k_los, k_strongest
from sounder.parameters.path_loss import path_loss
from sounder.parameters.selection import Selection
from sounder.parameters.uncertainty import Paths, standard_deviations

COHERENCE_LEVEL = 0.5
"""Correlation that defines the coherence bandwidth [1]."""
SLOPE_STEP = 1e-4
"""Step of the frequency at which the slope of the correlation is taken, relative to the coherence bandwidth [1]."""

Real = NDArray[np.float64]


def position_parameters(
    selection: Selection, *, distance: float, los: int = -1, clusters: Clustering = "none"
) -> xr.Dataset:
    """Compute the parameters of a position.

    Parameters
    ----------
    selection : Selection
        Paths that count; from :func:`sounder.parameters.selection.select_mpcs` or ``select_pdp``.
    distance : float
        From TX to RX [m].
    los : int
        1 line of sight, 0 none, -1 unknown. Without line of sight there is no direct path.
    clusters : {"none", "k-power-means", "dbscan"}

    Returns
    -------
    xarray.Dataset
        A variable for each of :data:`sounder.parameters.catalogue.PARAMETERS`, each with ``units``, ``long_name`` and
        ``definition``; and the standard deviations, with ``_std``. NaN: not known, or not defined without paths.
        Attributes ``definition``, ``source``, ``threshold``, ``noise``, ``antennas``: how paths were selected.

    Examples
    --------
    >>> from sounder.parameters.selection import select_mpcs
    >>> columns = {"delay": [1e-7, 2e-7], "azimuth": [0, 90], "elevation": [0, 0], "path_gain": [-100, -100]}
    >>> mpcs = xr.Dataset({name: ("mpc", np.array(values, float)) for name, values in columns.items()})
    >>> result = position_parameters(select_mpcs(mpcs), distance=29.9792458)
    >>> print(f"{float(result['rms_delay_spread']) * 1e9:.1f} ns, {float(result['azimuth_spread_arrival']):.2f} degree")
    50.0 ns, 47.70 degree
    """
    mpcs = selection.paths
    paths = Paths.of(mpcs)
    direct = _direct(mpcs, distance) if los != 0 else np.zeros(mpcs.sizes["mpc"], bool)

    def parameters(some: Paths) -> dict[str, Real]:
        return _parameters(some, direct)

    values = {name: float(value) for name, value in parameters(paths).items()}
    std = standard_deviations(paths, mpcs, parameters)
    values["mpcs"] = mpcs.sizes["mpc"]
    values["coherence_bandwidth"], std["coherence_bandwidth"] = _coherence(paths, mpcs)
    if {"departure_azimuth", "departure_elevation"} <= set(mpcs):
        azimuth, elevation = (mpcs[f"departure_{name}"].values for name in ("azimuth", "elevation"))
        values |= {name: float(value) for name, value in _spreads(azimuth, elevation, paths.power, "departure").items()}
    if clusters != "none" and selection.source == "mpcs":
        where = paths.delay, paths.azimuth, paths.elevation, paths.power
        values |= cluster_spreads(*where, find_clusters(*where, clusters))
    columns = {}
    for name, parameter in PARAMETERS.items():
        attributes = {"units": parameter.unit, "long_name": parameter.text, "definition": parameter.definition}
        columns[name] = ((), values.get(name, np.nan), attributes)
        if name in std:
            about = {"units": parameter.unit, "long_name": f"standard deviation of {parameter.text}"}
            columns[f"{name}_std"] = ((), std[name], about)
    texts = {name: getattr(selection, name) for name in ("definition", "source", "threshold", "noise", "antennas")}
    return xr.Dataset(columns, attrs=texts | {"clusters": clusters})


def _parameters(paths: Paths, direct: NDArray[np.bool_]) -> dict[str, Real]:
    """Parameters of paths (..., path) that are smooth functions of the MPCs."""
    delay, power = paths.delay, paths.power
    return {
        "path_loss": path_loss(power),
        "rms_delay_spread": rms_delay_spread(delay, power),
        "mean_excess_delay": mean_excess_delay(delay, power),
        "maximum_excess_delay": maximum_excess_delay(delay, power),
        **_spreads(paths.azimuth, paths.elevation, power, "arrival"),
        "k_strongest": k_strongest(power),
        "k_los": k_los(power, direct),
    }


def _spreads(azimuth: Real, elevation: Real, power: Real, end: str) -> dict[str, Real]:
    kinds: dict[str, Spread] = {"": "tr38901", "_fleury": "fleury"}
    return {
        f"{name}_spread_{end}{suffix}": angular_spread(angle, power, kind)
        for name, angle in (("azimuth", azimuth), ("zenith", elevation))
        for suffix, kind in kinds.items()
    }


def _direct(mpcs: xr.Dataset, distance: float) -> NDArray[np.bool_]:
    """The strongest MPC (mpc,) at the delay of the direct path, if there is one."""
    delay = mpcs["delay"].values
    std = np.nan_to_num(mpcs["delay_std"].values) if "delay_std" in mpcs else 0.0
    near = np.abs(delay - distance / c) <= SAME_DELAY + 3 * std
    gain = np.where(near, mpcs["path_gain"].values, -np.inf)
    return np.asarray(near & (gain == gain.max(initial=-np.inf)))


def _coherence(paths: Paths, mpcs: xr.Dataset) -> tuple[float, float]:
    """Coherence bandwidth and its standard deviation, from that of the correlation there over its slope."""
    bandwidth = coherence_bandwidth(paths.delay, paths.power, COHERENCE_LEVEL)
    if not np.isfinite(bandwidth):
        return bandwidth, float("nan")

    def correlation(some: Paths, at: float = bandwidth) -> dict[str, Real]:
        return {"correlation": frequency_correlation(some.delay, some.power, at)}

    std = standard_deviations(paths, mpcs, correlation)["correlation"]
    step = SLOPE_STEP * bandwidth
    up, down = (float(correlation(paths, bandwidth + sign * step)["correlation"]) for sign in (1, -1))
    slope = abs(up - down) / (2 * step)
    return bandwidth, std / slope if slope > 0 else float("nan")
