"""What one setting of an instrument gave, and what with one thing taken away (`erm.letter.ablation`)."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from erm.evaluation.outline import evaluate_walls, point_errors, summary
from erm.geometry.vertical import FloatArray, reflection_point
from erm.letter.ablation import Parts, parts
from erm.letter.captures import Campaign
from erm.letter.methods import MERGED
from erm.letter.routes import Study, perpendicular_errors
from erm.letter.truth import Rays, behind, is_single_wall_bounce, rays_of
from erm.maps.environment import Environment
from erm.maps.outline import outline_of
from erm.mpcs.selection import select
from erm.mpcs.table import path_length
from erm.reconstruction.reconstruct import reconstruct

if TYPE_CHECKING:
    import xarray as xr

ON_WALL = 0.3  # m; a true reflection point nearer than this to a wall of the map is on it
Located = Mapping[tuple[str, int], float]
"""By position and number of its ray: distance in plan of a single bounce's reflection point from the true one [m]."""


@dataclass(frozen=True)
class Outcome:
    """What one setting gave at one choice of positions.

    Parameters
    ----------
    positions : int
    snr : float
        Median over the MPCs of power over noise [dB].
    mpcs : int
    stray : int
        MPCs that no path explains: remainders of stronger ones, and paths that were not told apart.
    there, measured : int
        Single bounces off walls that the positions had, and of these such as an MPC was found of.
    completeness : float
        Share of the true reflection points of the densest positions that lie on a wall of the map.
    of_known, of_honest, of_exact : float
        The same of maps made from the same MPCs without the strays; with standard deviations that hold; from the single
        bounces alone, without errors of delay and azimuth.
    excess : float
        How many times the RMS error of the single bounces exceeds their median standard deviation, in delay or in
        azimuth, whichever is worse.
    false : int
        Walls that stand for no face.
    point_error : float
        RMSE in plan of the reflection points of single MPCs, to the true ones [m]; of those that make the map.
    shared_error : float
        The same of the single bounces that were measured with every value of the knob [m].
    wall_error, wall_honest : float
        RMSE of merged reflection points across their face [m]; and on the map of standard deviations that hold.
    """

    positions: int
    snr: float
    mpcs: int
    stray: int
    there: int
    measured: int
    completeness: float
    of_known: float
    of_honest: float
    of_exact: float
    excess: float
    false: int
    point_error: float
    shared_error: float
    wall_error: float
    wall_honest: float


def true_points(campaign: Campaign) -> FloatArray:
    """Where the single bounces off walls of a campaign truly are (point, 2) [m]."""
    rays = rays_of(campaign.to_order(1))
    return rays.vertex[is_single_wall_bounce(campaign, rays), :2]


def judged(studied: Study, reference: FloatArray) -> tuple[Outcome, Located]:
    """Judge a map by true reflection points (point, 2), and its own reflection points by theirs.

    Returns
    -------
    outcome : Outcome
        ``shared_error`` is NaN: the other values are not known here.
    located : dict
        Of every single bounce that was measured.
    """
    rays = rays_of(studied.campaign)
    taken = parts(studied.mpcs, studied.campaign)
    kept = studied.table.isel(mpc=np.flatnonzero(studied.on_walls & (studied.face >= 0)))
    there = rays.vertex[behind(kept, studied.campaign, rays), :2]
    environment, table = reconstruct(select(taken.honest))
    honest = replace(studied, environment=environment, table=table)
    outcome = Outcome(
        positions=len(studied.campaign.links),
        snr=studied.snr,
        mpcs=studied.mpcs.sizes["mpc"],
        stray=studied.mpcs.sizes["mpc"] - taken.known.sizes["mpc"],
        there=taken.there,
        measured=taken.measured,
        completeness=completeness(studied.environment, reference),
        of_known=completeness(mapped(taken.known), reference),
        of_honest=completeness(environment, reference),
        of_exact=completeness(mapped(taken.exact), reference),
        excess=max(taken.excess.values()),
        false=int(evaluate_walls(studied.environment, outline_of(studied.campaign.environment))["false"]),
        point_error=summary(np.linalg.norm(kept["reflection_point"].values[:, :2] - there, axis=1))["rmse"],
        shared_error=float("nan"),
        wall_error=_across(studied),
        wall_honest=_across(honest),
    )
    return outcome, _located(taken, studied.campaign, rays)


def _across(studied: Study) -> float:
    """RMSE of merged points of true single bounces across their face [m]."""
    return summary(perpendicular_errors(studied, studied.on_walls & (studied.face >= 0))[MERGED])["rmse"]


def mapped(table: "xr.Dataset") -> Environment:
    """Map of a table's MPCs."""
    return reconstruct(select(table))[0]


def completeness(environment: Environment, reference: FloatArray) -> float:
    """Share of true reflection points (point, 2) within `ON_WALL` of a wall of the map."""
    walls = outline_of(environment)
    return float(np.mean(point_errors(reference, walls).distance < ON_WALL)) if len(walls) else 0.0


def root_mean_square(located: Located, of: set[tuple[str, int]]) -> float:
    """RMSE of some located bounces [m]; NaN of none."""
    return summary([located[one] for one in sorted(of)])["rmse"]


def _located(taken: Parts, campaign: Campaign, rays: Rays) -> Located:
    singles = taken.singles
    ends = singles["tx_position"].values, singles["rx_position"].values
    point, _ = reflection_point(*ends, path_length(singles), singles["azimuth"].values)
    error = np.linalg.norm(point - rays.vertex[taken.ray, :2], axis=1)
    first = np.searchsorted(rays.link, np.arange(len(campaign.links)))
    number = taken.ray - first[rays.link[taken.ray]]
    weakest_first = np.argsort(singles["path_gain"].values, kind="stable")  # of two at one path the stronger counts
    names = singles["position"].values
    return {(str(names[i]), int(number[i])): float(error[i]) for i in weakest_first.tolist() if np.isfinite(error[i])}
