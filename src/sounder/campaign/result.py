"""What was made of a campaign, from its products to its map and its score."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import xarray as xr
from numpy.typing import NDArray

from erm.maps.environment import Environment


@dataclass
class Result:
    """What was made of a campaign.

    Attributes
    ----------
    out : Path
        Folder of all that was made.
    positions : int
        Positions of the campaign that could be opened.
    products : dict of Path to xarray.Dataset
        Products and their root groups, one a position, in the order of the campaign.
    already : int
        How many of them were there and were not made again.
    table, located : xarray.Dataset
        MPCs of all positions as measured; and as :func:`erm.reconstruction.reconstruct.reconstruct` returns them.
    environment : Environment
        The map.
    outline : array (segment, 2 ends, 2) or None
        Faces to judge the map by [m].
    score : dict
        What the outline says of the map; empty without one.
    map_figure : Path
    figures : dict of Path to list of Path
        Figures of positions, by their product.
    failures, notes : list of str
        One line each.
    """

    out: Path
    map_figure: Path
    positions: int
    products: dict[Path, xr.Dataset]
    already: int
    table: xr.Dataset
    located: xr.Dataset
    environment: Environment
    outline: NDArray[Any] | None = None
    score: dict[str, Any] = field(default_factory=dict)
    figures: dict[Path, list[Path]] = field(default_factory=dict)
    failures: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
