"""The letter's four routes from captures: maps, and errors of reflection points by its method and by ours."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from erm.common.constants import c
from erm.evaluation.outline import point_errors, summary
from erm.geometry.vertical import FloatArray, reflection_point, unit
from erm.letter.captures import UNCHANGED, Campaign, Captures, Change
from erm.letter.methods import MERGED, PLANAR, SINGLE
from erm.letter.published import TABLE_2
from erm.letter.truth import NO_PATH, IntArray, is_single_wall_bounce, rays_of, true_ray
from erm.maps.environment import Environment
from erm.maps.outline import outline_of
from erm.mpcs.selection import select
from erm.mpcs.table import path_length
from erm.reconstruction.reconstruct import reconstruct

if TYPE_CHECKING:
    import xarray as xr

SCENE = "uma"
AZIMUTH_STEP, SAMPLE_RATE = 10.0, 1.2e9  # degree, Hz; of the letter's scan and samples


@dataclass(frozen=True)
class Study:
    """Measurements and map of a campaign.

    Parameters
    ----------
    campaign : Campaign
    mpcs : xarray.Dataset
        MPC table of the measurements.
    daps : mapping of str to xarray.Dataset
        By position.
    environment : Environment
        Map from all positions together.
    table : xarray.Dataset
        Table that `erm.reconstruct` returns.
    face : array (mpc,)
        Reflector of the true environment off which each component bounced; -1 for components that are not single
        bounces off a wall.
    snr : float
        Median SNR of the components [dB].
    """

    campaign: Campaign
    mpcs: "xr.Dataset"
    daps: Mapping[str, "xr.Dataset"]
    environment: Environment
    table: "xr.Dataset"
    face: IntArray
    snr: float

    @property
    def on_walls(self) -> npt.NDArray[np.bool_]:
        """Components (mpc,) that are on the map as single bounces off walls."""
        kind = self.environment.reflectors["kind"].values
        wall = self.table["wall"].values
        return self.table["accepted"].values & np.isin(wall, np.flatnonzero(kind == "wall"))

    def of(self, names: Collection[str]) -> npt.NDArray[np.bool_]:
        """Components (mpc,) of the positions ``names``."""
        return np.isin(self.table["position"].values, list(names))


def study(
    campaign: Campaign,
    captures: Captures,
    change: Change = UNCHANGED,
    *,
    progress: Callable[[], None] | None = None,
) -> Study:
    """Measure a campaign and reconstruct its map."""
    measured = captures.measure(campaign, change, progress=progress)
    environment, table = reconstruct(select(measured.mpcs))
    rays = rays_of(campaign)
    ray = true_ray(table, campaign, rays)
    single = (ray != NO_PATH) & is_single_wall_bounce(campaign, rays)[ray]
    face = np.where(single, rays.reflector[ray], -1)
    return Study(campaign, measured.mpcs, measured.daps, environment, table, face, measured.median_snr)


def perpendicular_errors(studied: Study, chosen: npt.NDArray[np.bool_]) -> dict[str, FloatArray]:
    """The letter's ``D_Error`` of the same components by three methods.

    The face is the one that truly reflected the component, even if another is nearer to the point. For a component that
    is not a single bounce, it is the face nearest to the merged point.

    Parameters
    ----------
    chosen : array (mpc,) of bool

    Returns
    -------
    dict of str to array (point,)
        Errors [m] by `PLANAR`, `SINGLE`, `MERGED`.
    """
    kept = studied.table.isel(mpc=np.flatnonzero(chosen))
    path = (kept["tx_position"].values, kept["rx_position"].values, path_length(kept), kept["azimuth"].values)
    planar, _ = reflection_point(*path, planar=True)
    points = {
        PLANAR: planar,
        SINGLE: kept["reflection_point"].values[:, :2],
        MERGED: kept["wall_point"].values[:, :2],
    }
    return {name: np.abs(across(studied, chosen, point)) for name, point in points.items()}


def across(studied: Study, chosen: npt.NDArray[np.bool_], points: FloatArray) -> FloatArray:
    """Signed distance (..., point) of points of the chosen components from the lines of their faces [m].

    Positive behind the face, seen from the receiver.

    Parameters
    ----------
    chosen : array (mpc,) of bool
    points : array (..., point, 2)
        One for each chosen component [m].
    """
    rows = np.flatnonzero(chosen)
    truth = studied.campaign.environment
    walls = np.flatnonzero(truth.reflectors["kind"].values == "wall")
    nearest = walls[point_errors(studied.table["wall_point"].values[rows], outline_of(truth)).face]
    face = np.where(studied.face[rows] >= 0, studied.face[rows], nearest)
    normal = unit(truth.reflectors["normal"].values[face])
    offset = truth.reflectors["offset"].values[face]
    side = np.sign(np.sum(normal * studied.table["rx_position"].values[rows, :2], axis=1) - offset)
    return -side * (np.sum(normal * points, axis=-1) - offset)


@dataclass(frozen=True)
class Limited:
    """Errors of every route with each limit of the letter's method on or off, for the same components.

    Parameters
    ----------
    planar : bool
        Whether the slant length is used as the horizontal one.
    azimuths, delays : bool
        Whether azimuths are those of the scan's beams, and delays those of the samples.
    error : dict of str to array (point,)
        Errors by route [m].
    """

    planar: bool
    azimuths: bool
    delays: bool
    error: dict[str, FloatArray]


def limits(studied: Study, *, step: float = AZIMUTH_STEP, rate: float = SAMPLE_RATE) -> list[Limited]:
    """The letter's ``D_Error`` of the components on walls, with each limit of its method on and off.

    Parameters
    ----------
    step : float
        Azimuth step of the scan [degree].
    rate : float
        Sample rate [Hz].
    """
    found = []
    for planar, azimuths, delays in product((False, True), repeat=3):
        error = {}
        for route, positions in TABLE_2.items():
            chosen = studied.on_walls & studied.of(list(positions))
            kept = studied.table.isel(mpc=np.flatnonzero(chosen))
            azimuth, delay = kept["azimuth"].values, kept["delay"].values
            point, _ = reflection_point(
                kept["tx_position"].values,
                kept["rx_position"].values,
                (np.rint(delay * rate) / rate if delays else delay) * c,
                np.rint(azimuth / step) * step if azimuths else azimuth,
                planar=planar,
            )
            error[route] = np.abs(across(studied, chosen, point))
        found.append(Limited(planar, azimuths, delays, error))
    return found


def errors_by_route(studied: Study) -> dict[str, dict[str, FloatArray]]:
    """`perpendicular_errors` of the components on walls, by route [m]."""
    return {
        route: perpendicular_errors(studied, studied.on_walls & studied.of(list(positions)))
        for route, positions in TABLE_2.items()
    }


def false_by_route(studied: Study) -> dict[str, int]:
    """Number of components on walls that are not single bounces off a wall, by route."""
    return {
        route: int(np.count_nonzero(studied.on_walls & studied.of(list(positions)) & (studied.face < 0)))
        for route, positions in TABLE_2.items()
    }


def letter_selection(studied: Study) -> dict[str, FloatArray]:
    """Distance to the nearest face of the points by the letter's own selection (Eq. 4) and equations [m].

    Returns
    -------
    dict of str to array (point,)
        By route, of all components that Eq. 4 accepts, single bounces or not.
    """
    chosen = select(studied.mpcs, threshold="letter")
    kept = chosen.isel(mpc=np.flatnonzero(chosen["accepted"].values))
    path = (kept["tx_position"].values, kept["rx_position"].values, path_length(kept), kept["azimuth"].values)
    planar, _ = reflection_point(*path, planar=True)
    distance = point_errors(planar, outline_of(studied.campaign.environment)).distance
    position = kept["position"].values
    return {route: distance[np.isin(position, list(positions))] for route, positions in TABLE_2.items()}


def improvements(errors: Mapping[str, Mapping[str, FloatArray]]) -> dict[str, tuple[float, float]]:
    """For each route the merged RMSE [m], and the RMSE of the letter's method over it."""
    rmse = {
        route: {method: summary(values)["rmse"] for method, values in methods.items()}
        for route, methods in errors.items()
    }
    return {route: (values[MERGED], values[PLANAR] / values[MERGED]) for route, values in rmse.items()}
