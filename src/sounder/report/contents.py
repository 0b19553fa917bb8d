"""What the page of a campaign shows."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import xarray as xr
from numpy.typing import NDArray

from erm.maps.environment import Environment
from sounder.parameters.statistics import Statistic
from sounder.recordings.recording import BackToBack


@dataclass(frozen=True)
class Contents:
    """Everything that the page shows, from products and from what is made of them.

    Attributes
    ----------
    title : str
    summary : sequence of str
        Sentences under the title.
    products : mapping of Path to xarray.Dataset
        Products and their root groups.
    table, located : xarray.Dataset
        MPCs of all positions, as measured and as :func:`erm.reconstruct` returns them.
    environment : Environment
        The map.
    parameters : xarray.Dataset
        From :func:`sounder.channel_parameters`.
    statistics : sequence of Statistic
    outline : array (segment, 2 ends, 2) or None
        Known faces [m].
    score : mapping
        Result of `erm.evaluation.evaluate_map`; empty without an outline.
    failures, notes : sequence of str
        One line each.
    settings : sequence of (label, text)
        How the results were made.
    files : sequence of str
        Files beside the page, which it links.
    calibrations : sequence of BackToBack
    """

    title: str
    summary: Sequence[str]
    products: Mapping[Path, xr.Dataset]
    table: xr.Dataset
    located: xr.Dataset
    environment: Environment
    parameters: xr.Dataset
    statistics: Sequence[Statistic]
    outline: NDArray[Any] | None = None
    score: Mapping[str, Any] = field(default_factory=dict)
    failures: Sequence[str] = ()
    notes: Sequence[str] = ()
    settings: Sequence[tuple[str, str]] = ()
    files: Sequence[str] = ()
    calibrations: Sequence[BackToBack] = ()

    @property
    def names(self) -> list[str]:
        """Names of the positions, in the order of the products."""
        return [str(root["position"].item()) for root in self.products.values()]
