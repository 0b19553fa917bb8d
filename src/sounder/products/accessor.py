"""Accessor ``.sounder`` of datasets: the usual views of MPCs and DAPS."""

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from erm.common.constants import c
from erm.common.errors import DataError
from sounder.options import Clustering, Threshold
from sounder.parameters.position import position_parameters
from sounder.parameters.selection import Selection, select_mpcs, select_pdp

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NAME = "sounder"


class ProductAccessor:
    """Views of a group of a product that was opened with the engine ``sounder``.

    Examples
    --------
    >>> grid = ("azimuth", "elevation")
    >>> power = np.array([[[-90.0, -120.0]], [[-130.0, -110.0]]])
    >>> daps = xr.Dataset({"daps": ((*grid, "delay"), power), "noise_floor": (grid, [[-130.0], [-130.0]])})
    >>> ProductAccessor(daps).over_noise().values[:, 0].tolist()
    [[40.0, 10.0], [0.0, 20.0]]
    >>> ProductAccessor(daps).strongest_elevation().values.tolist()
    [[-90.0, -120.0], [-130.0, -110.0]]
    """

    def __init__(self, dataset: xr.Dataset) -> None:
        self._dataset = dataset

    @property
    def distance(self) -> float:
        """Distance from TX to RX [m]."""
        self._require("tx_position", "rx_position")
        return float(np.linalg.norm(self._dataset["tx_position"] - self._dataset["rx_position"]))

    @property
    def path_length(self) -> xr.DataArray:
        """Length of each path [m]."""
        self._require("delay")
        length = self._dataset["delay"] * c
        return length.assign_attrs(units="m", long_name="path length")

    @property
    def excess_delay(self) -> xr.DataArray:
        """Delay after the direct path, by the positions of TX and RX [s]."""
        self._require("delay")
        excess = self._dataset["delay"] - self.distance / c
        return excess.assign_attrs(units="s", long_name="delay after the direct path")

    def parameters(self, threshold: str | Threshold | None = None, *, clusters: Clustering = "none") -> xr.Dataset:
        """Channel parameters of the MPCs, or of the PDP of a DAPS; see :func:`sounder.channel_parameters`."""
        chosen = None if threshold is None else Threshold.of(threshold)
        selection: Selection
        if "path_gain" in self._dataset:
            selection = select_mpcs(self._dataset, chosen)
        else:
            self._require("pdp")
            selection = select_pdp(self._dataset, chosen)
        los = int(self._dataset.attrs.get("los", -1))
        return position_parameters(selection, distance=self.distance, los=los, clusters=clusters)

    def over_noise(self) -> xr.DataArray:
        """DAPS over the noise floor of each direction [dB]."""
        self._require("daps", "noise_floor")
        difference = self._dataset["daps"] - self._dataset["noise_floor"]
        return difference.assign_attrs(units="dB", long_name="power over the noise floor")

    def strongest_elevation(self) -> xr.DataArray:
        """DAPS with the strongest elevation at each azimuth and delay [dB]."""
        self._require("daps")
        return self._dataset["daps"].max("elevation", keep_attrs=True)

    def plot_daps(self, ax: "Axes", *, mpcs: xr.Dataset | None = None) -> "Axes":
        """Draw the DAPS over delay and azimuth, with MPCs."""
        from sounder.figures.products import daps_cartesian

        self._require("daps")
        return daps_cartesian(self._dataset, ax, mpc=mpcs)

    def plot_polar(self, ax: Any) -> "Axes":
        """Draw the DAPS in polar form, into polar axes."""
        from sounder.figures.products import daps_polar

        self._require("daps")
        return daps_polar([(self._name, self._dataset)], ax)

    def plot_pdp(self, ax: "Axes") -> "Axes":
        """Draw the omnidirectional PDP."""
        from sounder.figures.products import pdp

        self._require("pdp")
        return pdp([(self._name, self._dataset)], ax)

    @property
    def _name(self) -> str:
        return str(self._dataset["position"].item()) if "position" in self._dataset else ""

    def _require(self, *names: str) -> None:
        """Refuse a dataset that has not what a view needs."""
        for name in names:
            if name not in self._dataset:
                raise DataError(f"the dataset has no {name}; open group /daps or /mpc of a product with engine=sounder")


xr.register_dataset_accessor(NAME)(ProductAccessor)
