"""Result of a campaign: products, MPC table, map and score."""

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import xarray as xr
from matplotlib.figure import Figure
from numpy.typing import NDArray

from erm.common.console import counted, save_figure
from erm.figures import plot_map
from erm.maps.environment import Environment
from erm.maps.reflectors import counted_reflectors
from erm.reconstruction.summary import explain_unused
from sounder.parameters.statistics import Statistic
from sounder.recordings.recording import BackToBack

if TYPE_CHECKING:
    from sounder.campaign.description import Campaign

PRODUCTS, FIGURES, TABLE, POINTS, REPORT = "products", "figures", "mpcs.csv", "reflection-points.csv", "report.html"
PARAMETERS, STATISTICS, POINT_DATA = "parameters.csv", "statistics.csv", "point-data.csv"
"""Names of files and folders in the folder of a campaign."""


@dataclass
class CampaignResult:
    """Result of a campaign.

    Attributes
    ----------
    campaign : Campaign
    out : Path
        Folder of all files.
    positions : int
        Positions of the campaign that could be opened.
    products : dict of Path to xarray.Dataset
        Products and their root groups, one for each position, in the order of the campaign.
    already : int
        Number of the products that existed and were kept.
    table : xarray.Dataset
        MPCs of all positions, as measured.
    located : xarray.Dataset
        The same, as :func:`erm.reconstruct` returns them.
    environment : Environment
        The map.
    parameters : xarray.Dataset
        Channel parameters of the positions.
    statistics : list of Statistic
        Of the parameters.
    calibrations : list of BackToBack
        Back-to-back recordings that the positions were calibrated by.
    outline : array (segment, 2 ends, 2) or None
        Known faces for the score [m].
    score : dict
        Result of `erm.evaluation.evaluate_map`; empty without an outline.
    figures : dict of Path to list of Path
        Figures of positions, by their product.
    failures, notes : list of str
        One line each.
    internal : bool
        Whether a position failed by an error of this software.
    """

    campaign: "Campaign"
    out: Path
    positions: int
    products: dict[Path, xr.Dataset]
    already: int
    table: xr.Dataset
    located: xr.Dataset
    environment: Environment
    parameters: xr.Dataset
    statistics: list[Statistic]
    calibrations: list[BackToBack]
    outline: NDArray[Any] | None = None
    score: dict[str, Any] = field(default_factory=dict)
    figures: dict[Path, list[Path]] = field(default_factory=dict)
    failures: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    internal: bool = False

    @property
    def map_figure(self) -> Path:
        """File of the figure of the map."""
        return map_figure(self.campaign, self.out)

    @property
    def reflectors(self) -> str:
        """Number of walls and poles of the map, and of the MPCs that support them, in words."""
        found = counted_reflectors(self.environment.reflectors["kind"].values.tolist())
        used, measured = int(self.located["accepted"].sum()), counted(self.table.sizes["mpc"], "MPC")
        return f"{found} from {used} of {measured}"

    @property
    def unknown_positions(self) -> list[str]:
        """One line for each position whose figures are asked for and that was not processed."""
        asked, source = self.campaign.figures.positions, self.campaign.source
        names = {str(root["position"].item()) for root in self.products.values()}
        unknown = [name for name in asked if name not in names] if isinstance(asked, tuple) else []
        return [f"{source}: figures.positions: {name} is not a processed position" for name in unknown]

    @property
    def summary(self) -> list[str]:
        """Lines about products, map and report."""
        folder = Path(os.path.normpath(self.out))  # to read, not to open: with links it may be another folder
        products = counted(len(self.products), "product")
        return [
            f"{folder}: {products}; {self.already} of {counted(self.positions, 'position')} kept from an earlier run",
            f"map: {self.reflectors}",
            *explain_unused(self.located, self.campaign.map.min_support),
            str(self.environment.reflectors.attrs["calibration"]),
            f"report: {folder / REPORT}",
        ]


def map_figure(campaign: "Campaign", out: Path) -> Path:
    """File of the figure of the map."""
    return out / FIGURES / f"map.{campaign.figures.format}"


def draw_map(result: CampaignResult) -> None:
    """Draw the map of a campaign, with its MPCs and the outline, into its file."""
    axes = Figure(figsize=(7.0, 6.0)).add_subplot()
    numbers = [str(i) for i in range(result.environment.reflectors.sizes["reflector"])]
    plot_map(result.environment, table=result.located, outline=result.outline, names=numbers, annotated=True, ax=axes)
    save_figure(axes, result.map_figure)
