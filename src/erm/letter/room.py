"""The letter's ray-tracing verification: an L-shaped room, sensed from its rays and from captures.

The letter's RP error is the horizontal distance between the sensed point and the ray's true point. Its receiver is
omnidirectional and takes the azimuths from the ray tracer. Captures contain azimuths only if an antenna turns, so the
captures here are those of a rotating horn. Three approximations are switched with rays: delays with the resolution 1/B;
the planar equations, which use the slant length as the horizontal length; and rays of higher order.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from erm.common.constants import c
from erm.evaluation.outline import summary
from erm.geometry.vertical import FloatArray, reflection_point
from erm.letter.ablation import split_by_cause
from erm.letter.captures import Campaign, Captures, Change
from erm.letter.methods import MERGED, PLANAR, SINGLE
from erm.letter.truth import NO_PATH, as_table, is_single_wall_bounce, rays_of, true_ray
from erm.mpcs.reasons import count_reasons
from erm.mpcs.selection import select
from erm.mpcs.table import path_length
from erm.reconstruction.reconstruct import reconstruct
from erm.tracing.fresnel import fresnel, roughness_factor

if TYPE_CHECKING:
    import xarray as xr

    from erm.maps.environment import Environment

SCENE = "lroom"
SMALL = 0.02  # m; the letter gives the share of smaller errors
BANDWIDTH = 1.2e9  # Hz; of the letter
HIGHER_ORDER = 2  # bounces of the rays of higher order
MARGIN = 2.0  # dB over the loss of a wall at normal incidence, for errors of the gain. Chosen; not derived


@dataclass(frozen=True)
class Row:
    """One way to sense the reflection points, and its errors.

    Parameters
    ----------
    label : str
    error : array (point,)
        Horizontal distance between the sensed point and the true one [m].
    """

    label: str
    error: FloatArray

    @property
    def statistics(self) -> dict[str, float]:
        """``count``, ``min``, ``max``, ``mean``, ``rmse`` [m] and the share under `SMALL`."""
        return summary(self.error) | {"small": float(np.mean(self.error < SMALL)) if self.error.size else np.nan}


@dataclass(frozen=True)
class Switched(Row):
    """Errors from rays with the letter's approximations switched on or off."""

    resolution: bool
    planar: bool
    higher: bool


@dataclass(frozen=True)
class Sensed:
    """The room from captures.

    Parameters
    ----------
    rows : tuple of Row
        Planar equations, single MPCs, merged walls: the same MPCs.
    environment : Environment
        Reconstructed.
    table : xarray.Dataset
        Result of `erm.reconstruct`: the components of the rows.
    mpcs, accepted, false : int
        Measured components; components on the map; components on the map that are not single bounces off a wall.
    available, measured : int
        Single bounces off walls, and how many of them were measured.
    of_explained, of_corrected, of_exact : int
        Components on the map with one cause of errors removed (`erm.letter.ablation`).
    rejected : dict of str to int
        Number of measured single bounces that are not on the map, by reason.
    excess : dict of str to float
        RMS errors over the standard deviations of the table, as in `erm.letter.ablation.Parts`.
    snr : float
        Median [dB].
    """

    rows: tuple[Row, ...]
    environment: "Environment"
    table: "xr.Dataset"
    mpcs: int
    accepted: int
    false: int
    available: int
    measured: int
    of_explained: int
    of_corrected: int
    of_exact: int
    rejected: dict[str, int]
    excess: dict[str, float]
    snr: float


def largest_loss(campaign: Campaign) -> float:
    """Loss of a single bounce off the room's plaster at normal incidence, with a margin [dB].

    It is the product of Fresnel's coefficient and the roughness factor. Normal incidence has the largest loss.
    """
    losses = []
    for material in campaign.environment.materials.values():
        permittivity = np.array([material.relative_permittivity(campaign.frequency)])
        te, _ = fresnel(np.ones(1), permittivity)
        kept = roughness_factor(np.ones(1), np.array([material.height_deviation]), campaign.frequency)
        losses.append(-20 * float(np.log10(np.abs(te * kept)[0])))
    return max(losses) + MARGIN


def switches(campaign: Campaign) -> list[Switched]:
    """Errors of reflection points sensed from rays, for every setting of the three switches.

    The rays of higher order are those that the letter's selection accepts: the strongest of its cluster, with no more
    loss than a single bounce can have.
    """
    rays = rays_of(campaign.to_order(HIGHER_ORDER))
    table = as_table(campaign, rays)
    single = is_single_wall_bounce(campaign, rays)
    accepted = select(table, threshold="fixed", max_reflection_loss=largest_loss(campaign))["accepted"].values
    settings = []
    for resolution, planar, higher in product((False, True), repeat=3):
        chosen = accepted if higher else single
        error = _ray_errors(
            table.isel(mpc=chosen), rays.vertex[chosen], rate=BANDWIDTH if resolution else None, planar=planar
        )
        settings.append(Switched("from rays", error, resolution, planar, higher))
    return settings


def grids(campaign: Campaign, finer: Sequence[int] = (1, 2, 4, 8)) -> list[Row]:
    """Errors of reflection points sensed from first-order rays whose delays lie on grids finer than 1/B."""
    rays = rays_of(campaign.to_order(1))
    single = is_single_wall_bounce(campaign, rays)
    table = as_table(campaign, rays).isel(mpc=single)
    return [
        Row(
            f"1/({BANDWIDTH * times / 1e9:g} GHz)",
            _ray_errors(table, rays.vertex[single], rate=BANDWIDTH * times, planar=False),
        )
        for times in finer
    ]


def sense(
    campaign: Campaign,
    captures: Captures,
    change: Change,
    *,
    progress: Callable[[], None] | None = None,
) -> Sensed:
    """Measure and reconstruct the room, and compare the reflection points with those of the rays."""
    measured = captures.measure(campaign, change, progress=progress)
    environment, merged = _reconstructed(measured.mpcs, campaign)
    accepted = merged.isel(mpc=np.flatnonzero(merged["accepted"].values))
    rays = rays_of(campaign)
    ray = true_ray(accepted, campaign, rays)
    single = (ray != NO_PATH) & is_single_wall_bounce(campaign, rays)[ray]
    kept, truth = accepted.isel(mpc=np.flatnonzero(single)), rays.vertex[ray[single], :2]
    planar, _ = reflection_point(*_ends(kept), path_length(kept), kept["azimuth"].values, planar=True)
    points = {
        PLANAR: planar,
        SINGLE: kept["reflection_point"].values[:, :2],
        MERGED: kept["wall_point"].values[:, :2],
    }
    rows = tuple(Row(name, np.linalg.norm(value - truth, axis=1)) for name, value in points.items())
    causes = split_by_cause(measured.mpcs, campaign)
    ray_of_all = true_ray(merged, campaign, rays)
    singles = (ray_of_all != NO_PATH) & is_single_wall_bounce(campaign, rays)[ray_of_all]
    rejected = count_reasons(merged["reason"].values[singles & ~merged["accepted"].values].tolist())
    searched = {
        name: _reconstructed(getattr(causes, name), campaign)[1] for name in ("explained", "corrected", "exact")
    }
    return Sensed(
        rows=rows,
        environment=environment,
        table=kept,
        mpcs=measured.mpcs.sizes["mpc"],
        accepted=accepted.sizes["mpc"],
        false=int(np.count_nonzero(~single)),
        available=causes.available,
        measured=causes.measured,
        **{f"of_{name}": int(table["accepted"].sum()) for name, table in searched.items()},
        rejected={reason.text: count for reason, count in rejected.items()},
        excess=causes.excess,
        snr=measured.median_snr,
    )


def _reconstructed(table: "xr.Dataset", campaign: Campaign) -> tuple["Environment", "xr.Dataset"]:
    return reconstruct(select(table, max_reflection_loss=largest_loss(campaign)))


def placements(campaign: Campaign) -> dict[str, list[Row]]:
    """Errors from first-order rays with the transmitter at the place of each receiver in turn, by approximation.

    The places of the letter's antennas are not printed. This shows how much its numbers depend on them.

    Returns
    -------
    dict of str to list of Row
        ``resolution``, ``planar``; a row for each place.
    """
    height = campaign.links[0].tx[2]
    found: dict[str, list[Row]] = {"resolution": [], "planar": []}
    for place in campaign.links:
        tx = (*place.rx[:2], height)
        moved = campaign.to_order(1).at([replace(link, tx=tx) for link in campaign.links if link is not place])
        rays = rays_of(moved)
        single = is_single_wall_bounce(moved, rays)
        table, vertex = as_table(moved, rays).isel(mpc=single), rays.vertex[single]
        found["resolution"].append(Row(place.name, _ray_errors(table, vertex, rate=BANDWIDTH, planar=False)))
        found["planar"].append(Row(place.name, _ray_errors(table, vertex, rate=None, planar=True)))
    return found


def _ray_errors(table: "xr.Dataset", vertex: FloatArray, *, rate: float | None, planar: bool) -> FloatArray:
    """Horizontal distances of sensed points from those of the rays (ray, xyz) [m], where a point exists."""
    delay = table["delay"].values
    if rate is not None:
        delay = np.rint(delay * rate) / rate
    point, _ = reflection_point(*_ends(table), delay * c, table["azimuth"].values, planar=planar)
    error = np.linalg.norm(point - vertex[:, :2], axis=1)
    return error[np.isfinite(error)]


def _ends(table: "xr.Dataset") -> tuple[npt.NDArray, npt.NDArray]:
    return table["tx_position"].values, table["rx_position"].values
