"""Results of one setting of an instrument, also with one cause of errors removed (`erm.letter.ablation`)."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from erm.evaluation.outline import evaluate_walls, point_errors, summary
from erm.geometry.vertical import FloatArray, reflection_point
from erm.letter.ablation import Parts, split_by_cause
from erm.letter.captures import Campaign
from erm.letter.methods import MERGED
from erm.letter.routes import Study, perpendicular_errors
from erm.letter.truth import Rays, is_single_wall_bounce, rays_of, true_ray
from erm.maps.environment import Environment
from erm.maps.outline import outline_of
from erm.mpcs.selection import select
from erm.mpcs.table import path_length
from erm.reconstruction.reconstruct import reconstruct

if TYPE_CHECKING:
    import xarray as xr

ON_WALL = 0.3  # m; a true reflection point nearer than this to a wall of the map is on it. Chosen; not derived
Located = Mapping[tuple[str, int], float]
"""Horizontal error [m] of the reflection point of each single bounce, by position and number of its ray."""


@dataclass(frozen=True)
class Outcome:
    """Results of one setting at one choice of positions.

    Parameters
    ----------
    positions : int
    snr : float
        Median SNR of the MPCs [dB].
    mpcs : int
    stray : int
        MPCs that no path explains: residues of stronger ones, and paths that were not separated.
    available, measured : int
        Single bounces off walls at these positions, and how many of them were found.
    completeness : float
        Share of the true reflection points of the densest positions that lie on a wall of the map.
    of_explained, of_corrected, of_exact : float
        The same for maps from the MPCs that a path explains; from all MPCs with corrected standard deviations; from the
        single bounces alone, without errors of delay and azimuth.
    excess : float
        RMS error of the single bounces over their median standard deviation, of delay or azimuth, whichever is larger.
    false : int
        Walls of the map where no face stands.
    point_error : float
        Horizontal RMSE of the reflection points of single MPCs [m], of those on the map.
    shared_error : float
        The same for the single bounces that were found with every value of the setting [m].
    wall_error, wall_corrected : float
        RMSE of merged reflection points across their face [m]; and on the map with corrected standard deviations.
    """

    positions: int
    snr: float
    mpcs: int
    stray: int
    available: int
    measured: int
    completeness: float
    of_explained: float
    of_corrected: float
    of_exact: float
    excess: float
    false: int
    point_error: float
    shared_error: float
    wall_error: float
    wall_corrected: float


def true_points(campaign: Campaign) -> FloatArray:
    """True reflection points (point, 2) of the single bounces off walls [m]."""
    rays = rays_of(campaign.to_order(1))
    return rays.vertex[is_single_wall_bounce(campaign, rays), :2]


def evaluate_setting(studied: Study, reference: FloatArray) -> tuple[Outcome, Located]:
    """Compare a map and its reflection points with true reflection points (point, 2).

    Returns
    -------
    outcome : Outcome
        ``shared_error`` is NaN: the results of the other values are needed for it.
    located : dict
        Errors of all single bounces that were found.
    """
    rays = rays_of(studied.campaign)
    causes = split_by_cause(studied.mpcs, studied.campaign)
    kept = studied.table.isel(mpc=np.flatnonzero(studied.on_walls & (studied.face >= 0)))
    true = rays.vertex[true_ray(kept, studied.campaign, rays), :2]
    environment, table = reconstruct(select(causes.corrected))
    corrected = replace(studied, environment=environment, table=table)
    outcome = Outcome(
        positions=len(studied.campaign.links),
        snr=studied.snr,
        mpcs=studied.mpcs.sizes["mpc"],
        stray=studied.mpcs.sizes["mpc"] - causes.explained.sizes["mpc"],
        available=causes.available,
        measured=causes.measured,
        completeness=completeness(studied.environment, reference),
        of_explained=completeness(map_of(causes.explained), reference),
        of_corrected=completeness(environment, reference),
        of_exact=completeness(map_of(causes.exact), reference),
        excess=max(causes.excess.values()),
        false=int(evaluate_walls(studied.environment, outline_of(studied.campaign.environment))["false"]),
        point_error=summary(np.linalg.norm(kept["reflection_point"].values[:, :2] - true, axis=1))["rmse"],
        shared_error=float("nan"),
        wall_error=_across(studied),
        wall_corrected=_across(corrected),
    )
    return outcome, _located(causes, studied.campaign, rays)


def _across(studied: Study) -> float:
    """RMSE across the face of the merged points of true single bounces [m]."""
    return summary(perpendicular_errors(studied, studied.on_walls & (studied.face >= 0))[MERGED])["rmse"]


def map_of(table: "xr.Dataset") -> Environment:
    """Reconstruct the map of a table of MPCs."""
    return reconstruct(select(table))[0]


def completeness(environment: Environment, reference: FloatArray) -> float:
    """Share of true reflection points (point, 2) within `ON_WALL` of a wall of the map."""
    walls = outline_of(environment)
    return float(np.mean(point_errors(reference, walls).distance < ON_WALL)) if len(walls) else 0.0


def root_mean_square(located: Located, of: set[tuple[str, int]]) -> float:
    """RMSE of some single bounces [m]; NaN if there are none."""
    return summary([located[one] for one in sorted(of)])["rmse"]


def _located(causes: Parts, campaign: Campaign, rays: Rays) -> Located:
    singles = causes.singles
    ends = singles["tx_position"].values, singles["rx_position"].values
    point, _ = reflection_point(*ends, path_length(singles), singles["azimuth"].values)
    error = np.linalg.norm(point - rays.vertex[causes.ray, :2], axis=1)
    first = np.searchsorted(rays.link, np.arange(len(campaign.links)))
    number = causes.ray - first[rays.link[causes.ray]]
    weakest_first = np.argsort(
        singles["path_gain"].values, kind="stable"
    )  # the stronger of two MPCs of one path counts
    names = singles["position"].values
    return {(str(names[i]), int(number[i])): float(error[i]) for i in weakest_first.tolist() if np.isfinite(error[i])}
