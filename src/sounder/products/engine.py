"""Engine ``sounder`` of `xarray.open_dataset` and `xarray.open_datatree`: products with the facts of their position."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import xarray as xr
from xarray.backends import BackendEntrypoint

from erm.common.errors import DataError
from erm.common.gate.hdf5 import Group, open_hdf5
from erm.common.storage import SOFTWARE, open_group
from sounder.products import accessor  # noqa: F401 (registers the accessor)

FACTS = ("frequency", "los")
"""Attributes of the root that each group gets."""
PLACES = ("tx_position", "rx_position")


class ProductEngine(BackendEntrypoint):
    """Opens a product of ``sounder process``, or another HDF5 file of this software.

    A group of a product gets what its root says of the position: the coordinates ``position``, ``tx_position`` and
    ``rx_position``, and the attributes :data:`FACTS`. Everything is read into memory, with the checks of all commands.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import sounder
    >>> from sounder import shipped
    >>> recordings, b2b = [shipped.calibration("recording-132ghz.h5")], shipped.calibration("back-to-back-132ghz.h5")
    >>> jobs, _ = sounder.gather(recordings, calibration=b2b)
    >>> (product,) = sounder.process(jobs, pathlib.Path(tempfile.mkdtemp())).products
    >>> mpcs = xr.open_dataset(product, engine=ProductEngine)  # once installed: engine="sounder"
    >>> mpcs["position"].item(), mpcs.sizes["mpc"]
    ('synthetic-two-paths', 2)
    >>> f"{float(mpcs.sounder.parameters()['rms_delay_spread']) * 1e9:.1f} ns"
    '12.3 ns'
    >>> sorted(xr.open_datatree(product, engine=ProductEngine).children)
    ['daps', 'mpc', 'quality']
    """

    description = "Products of sounder process: groups with the facts of their position"
    open_dataset_parameters = ("filename_or_obj", "drop_variables", "group")
    supports_groups = True

    def open_dataset(
        self,
        filename_or_obj: Any,
        *,
        drop_variables: str | Iterable[str] | None = None,
        group: str | None = None,
    ) -> xr.Dataset:
        """Open a group; by default ``/mpc`` of a product, and the root of other files."""
        path = Path(filename_or_obj)
        with open_hdf5(path) as file:
            names = list(file)
        if group is None:
            group = "/mpc" if "mpc" in names else "/"
        dataset = open_group(path, group)
        if group.strip("/") and "mpc" in names:
            dataset = _with_facts(dataset, open_group(path))
        dropped = [drop_variables] if isinstance(drop_variables, str) else list(drop_variables or [])
        return dataset.drop_vars(dropped, errors="ignore")

    def open_groups_as_dict(
        self, filename_or_obj: Any, *, drop_variables: str | Iterable[str] | None = None
    ) -> dict[str, xr.Dataset]:
        """Open all groups as they are in the file, by their names."""
        path = Path(filename_or_obj)
        with open_hdf5(path) as file:
            names = ["/", *(f"/{name}" for name, node in file.items() if isinstance(node, Group))]
        dropped = [drop_variables] if isinstance(drop_variables, str) else list(drop_variables or [])
        return {name: open_group(path, name).drop_vars(dropped, errors="ignore") for name in names}

    def open_datatree(self, filename_or_obj: Any, *, drop_variables: str | Iterable[str] | None = None) -> xr.DataTree:
        """Open all groups as a tree."""
        return xr.DataTree.from_dict(self.open_groups_as_dict(filename_or_obj, drop_variables=drop_variables))

    def guess_can_open(self, filename_or_obj: Any) -> bool:
        """Whether a file is of this software."""
        try:
            with open_hdf5(Path(filename_or_obj)) as file:
                return str(file.attrs.get("source", "")).startswith(SOFTWARE.partition(" ")[0])
        except (DataError, TypeError):
            return False


def _with_facts(dataset: xr.Dataset, root: xr.Dataset) -> xr.Dataset:
    """Facts of the position as coordinates and attributes."""
    coordinates: dict[str, Any] = {}
    if "position" in root and root["position"].size == 1:
        coordinates["position"] = root["position"].values.item()
    coordinates |= {name: ("xyz", root[name].values[0], root[name].attrs) for name in PLACES if name in root}
    facts = {name: root.attrs[name] for name in FACTS if name in root.attrs}
    return dataset.assign_coords(coordinates).assign_attrs(facts)
