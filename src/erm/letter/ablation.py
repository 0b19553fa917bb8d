"""What stands between an instrument's MPCs and the map they could make: one thing taken away at a time.

The experiments need no captures of their own. The same MPCs are searched again

- without those that no path explains: remainders of stronger ones, and paths that were not told apart;
- with standard deviations that hold: widened, in quadrature, by the RMS error that the single bounces truly have;
- as single bounces off walls alone, at their true delays and azimuths.

What the map gains with a step is what that step takes away; what it does not gain was not measured, or no other
position shares it.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from erm.geometry.vertical import angle_difference
from erm.letter.captures import Campaign
from erm.letter.truth import NO_PATH, IntArray, behind, is_single_wall_bounce, rays_of

if TYPE_CHECKING:
    import xarray as xr

    from erm.geometry.vertical import FloatArray


class Parts(NamedTuple):
    """A campaign's MPCs, whole and with something taken away.

    Parameters
    ----------
    known, honest, singles, exact : xarray.Dataset
        MPC tables: those that a path explains; all, with standard deviations that hold; the single bounces off walls
        as measured; these at their true delays and azimuths.
    ray : array (mpc,)
        Index of the ray behind each single.
    there : int
        Single bounces that the campaign has.
    excess : dict of str to float
        How many times the RMS error of the singles' ``delay`` and ``azimuth`` exceeds the median standard deviation
        that the table gives them; NaN of none.
    """

    known: "xr.Dataset"
    honest: "xr.Dataset"
    singles: "xr.Dataset"
    exact: "xr.Dataset"
    ray: IntArray
    there: int
    excess: dict[str, float]

    @property
    def measured(self) -> int:
        """Single bounces that an MPC was found of."""
        return len(np.unique(self.ray))


def parts(table: "xr.Dataset", campaign: Campaign) -> Parts:
    """Take a campaign's MPCs apart by the rays behind them."""
    rays = rays_of(campaign)
    ray = behind(table, campaign, rays)
    single = is_single_wall_bounce(campaign, rays)
    chosen = np.flatnonzero((ray != NO_PATH) & single[ray])
    singles, of = table.isel(mpc=chosen), ray[chosen]
    true = {"delay": rays.delay[of], "azimuth": rays.azimuth[of] % 360}
    error = {
        "delay": singles["delay"].values - true["delay"],
        "azimuth": angle_difference(singles["azimuth"].values, true["azimuth"]),
    }
    return Parts(
        known=table.isel(mpc=np.flatnonzero(ray != NO_PATH)),
        honest=_widened(table, error),
        singles=singles,
        exact=singles.assign({name: ("mpc", values) for name, values in true.items()}),
        ray=of,
        there=int(np.count_nonzero(single)),
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
