"""Causes of map errors in the MPCs of an instrument: one cause is removed at a time (ablation).

The experiments need no new captures. The same MPCs are reconstructed again

- without those that no path explains: residues of stronger ones, and paths that were not separated;
- with corrected standard deviations: widened, in quadrature, by the true RMS error of the single bounces;
- as single bounces off walls alone, at their true delays and azimuths.

What the map gains in a step shows the effect of the cause that was removed. What it never gains was not measured, or
no other position shares it.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from erm.geometry.vertical import angle_difference
from erm.letter.captures import Campaign
from erm.letter.truth import NO_PATH, IntArray, is_single_wall_bounce, rays_of, true_ray

if TYPE_CHECKING:
    import xarray as xr

    from erm.geometry.vertical import FloatArray


class Parts(NamedTuple):
    """The MPCs of a campaign with one cause of errors removed in each table.

    Parameters
    ----------
    explained, corrected, singles, exact : xarray.Dataset
        MPC tables: the MPCs that a path explains; all MPCs with corrected standard deviations; the single bounces off
        walls as measured; the same at their true delays and azimuths.
    ray : array (mpc,)
        Index of the true ray of each single bounce.
    available : int
        Number of single bounces that the campaign has.
    excess : dict of str to float
        RMS error of the single bounces over their median standard deviation, for ``delay`` and ``azimuth``; NaN if
        there are none.
    """

    explained: "xr.Dataset"
    corrected: "xr.Dataset"
    singles: "xr.Dataset"
    exact: "xr.Dataset"
    ray: IntArray
    available: int
    excess: dict[str, float]

    @property
    def measured(self) -> int:
        """Number of single bounces that were found."""
        return len(np.unique(self.ray))


def split_by_cause(table: "xr.Dataset", campaign: Campaign) -> Parts:
    """Make the tables of a campaign's MPCs from the true ray of each."""
    rays = rays_of(campaign)
    ray = true_ray(table, campaign, rays)
    single = is_single_wall_bounce(campaign, rays)
    chosen = np.flatnonzero((ray != NO_PATH) & single[ray])
    singles, of = table.isel(mpc=chosen), ray[chosen]
    true = {"delay": rays.delay[of], "azimuth": rays.azimuth[of] % 360}
    error = {
        "delay": singles["delay"].values - true["delay"],
        "azimuth": angle_difference(singles["azimuth"].values, true["azimuth"]),
    }
    return Parts(
        explained=table.isel(mpc=np.flatnonzero(ray != NO_PATH)),
        corrected=_widened(table, error),
        singles=singles,
        exact=singles.assign({name: ("mpc", values) for name, values in true.items()}),
        ray=of,
        available=int(np.count_nonzero(single)),
        excess={name: _excess(values, singles[f"{name}_std"].values) for name, values in error.items()},
    )


def _widened(table: "xr.Dataset", error: dict[str, "FloatArray"]) -> "xr.Dataset":
    wider = {
        f"{name}_std": ("mpc", np.hypot(table[f"{name}_std"].values, np.sqrt(np.mean(values**2))))
        for name, values in error.items()
        if values.size
    }
    return table.assign(wider)


def _excess(error: "FloatArray", std: "FloatArray") -> float:
    return float(np.sqrt(np.mean(error**2)) / np.median(std)) if error.size else float("nan")
