"""The true path of each MPC of a simulated campaign."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from erm.geometry.vertical import FloatArray, angle_difference
from erm.letter.captures import Campaign
from erm.mpcs.table import make_table
from erm.tracing.trace import trace

if TYPE_CHECKING:
    import xarray as xr

DELAY_GATE = 0.5e-9  # s; half the resolution cell of 1 GHz
AZIMUTH_GATE = 3.0  # degree; a third of a beam
NO_PATH = -1
IntArray = npt.NDArray[np.int64]


class Rays(NamedTuple):
    """Traced paths of all links of a campaign, one per row."""

    link: IntArray  # index into the campaign's links
    delay: FloatArray  # s
    azimuth: FloatArray  # degree
    elevation: FloatArray  # degree
    path_gain: FloatArray  # dB
    order: IntArray  # number of bounces
    reflector: IntArray  # of the last bounce; negative for ground, ceiling, none
    vertex: FloatArray  # (ray, xyz), the last bounce [m]


def rays_of(campaign: Campaign) -> Rays:
    """Trace every link of a campaign to its ``max_order``."""
    parts: list[list[npt.NDArray]] = []
    for index, link in enumerate(campaign.links):
        paths = trace(campaign.environment, link.tx, link.rx, campaign.frequency, max_order=campaign.max_order)
        order = paths["order"].values
        rows, last = np.arange(len(order)), np.maximum(order - 1, 0)
        columns = [paths[name].values for name in ("delay", "azimuth", "elevation", "path_gain")]
        seen = [paths["reflector"].values[rows, last], paths["vertices"].values[rows, last]]
        parts.append([np.full(len(order), index), *columns, order, *seen])
    return Rays(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def as_table(campaign: Campaign, rays: Rays) -> "xr.Dataset":
    """Return rays as an MPC table without errors."""
    link = [campaign.links[index] for index in rays.link]
    return make_table(
        {
            "position": np.array([one.name for one in link]),
            "tx_position": np.array([one.tx for one in link]),
            "rx_position": np.array([one.rx for one in link]),
            "frequency": campaign.frequency,
            "delay": rays.delay,
            "azimuth": rays.azimuth,
            "elevation": rays.elevation,
            "path_gain": rays.path_gain,
        }
    )


def true_ray(table: "xr.Dataset", campaign: Campaign, rays: Rays) -> IntArray:
    """Index (mpc,) of the true ray of each component, -1 where no ray is near.

    It is the nearest in the plane of delay and azimuth within an ellipse of `DELAY_GATE` and `AZIMUTH_GATE`.
    """
    found = np.full(table.sizes["mpc"], NO_PATH)
    delay, azimuth = table["delay"].values, table["azimuth"].values
    for index, link in enumerate(campaign.links):
        candidates = np.flatnonzero(rays.link == index)
        rows = np.flatnonzero(table["position"].values == link.name)
        if len(candidates) == 0 or len(rows) == 0:
            continue
        late = (delay[rows, None] - rays.delay[candidates]) / DELAY_GATE
        turned = angle_difference(azimuth[rows, None], rays.azimuth[candidates]) / AZIMUTH_GATE
        apart = late**2 + turned**2
        nearest = np.argmin(apart, axis=1)
        found[rows] = np.where(apart.min(axis=1) < 1, candidates[nearest], NO_PATH)
    return found


def is_single_wall_bounce(campaign: Campaign, rays: Rays) -> npt.NDArray[np.bool_]:
    """Rays (ray,) with one bounce, off a wall. The letter's equations hold for these."""
    kind = campaign.environment.reflectors["kind"].values
    walls = np.flatnonzero(kind == "wall")
    return (rays.order == 1) & np.isin(rays.reflector, walls)
