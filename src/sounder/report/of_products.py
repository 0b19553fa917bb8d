"""The page of any products, without a campaign file."""

from collections.abc import Sequence
from pathlib import Path

import xarray as xr

from erm.common.console import counted
from erm.common.errors import DataError
from erm.common.gate.nesting import parse_json
from erm.common.page import cell
from erm.common.storage import open_group
from erm.common.usage import shortened
from erm.maps.environment import Environment
from erm.mpcs.files import PRODUCT, read_mpcs
from erm.reconstruction.make_map import make_map
from erm.survey.report import warnings
from sounder.parameters.statistics import campaign_statistics
from sounder.processing.channel_parameters import channel_parameters, notes_on_parameters
from sounder.report.contents import Contents

TABLES = ("processing_options", "input_sha256")
"""Attributes of a product that hold tables in JSON."""


def contents_of_products(products: Sequence[Path], title: str) -> Contents:
    """Make map and parameters of products with the defaults of ``erm reconstruct`` and ``sounder parameters``.

    Parameters
    ----------
    products : sequence of Path
    title : str

    Raises
    ------
    DataError
        No product can be used.
    """
    table, problems = read_mpcs(products)
    environment, located = make_map(table, history="sounder report", inputs=products)
    return contents_of_map(products, title, "sounder report", table, environment, located, failures=problems)


def contents_of_map(
    products: Sequence[Path],
    title: str,
    maker: str,
    table: xr.Dataset,
    environment: Environment,
    located: xr.Dataset,
    *,
    failures: Sequence[str] = (),
) -> Contents:
    """Make the parameters of products whose map there is.

    Parameters
    ----------
    products : sequence of Path
    title : str
    maker : str
        Command that makes the page.
    table, located : xarray.Dataset
        MPCs as measured and as the reconstruction returns them.
    environment : Environment
        The map.
    failures : sequence of str
        What failed before, one line each.
    """
    parameters, unusable = channel_parameters(products)
    usable = set(parameters["file"].values.tolist())
    roots = {path: _root(path) for path in products if path.name in usable}
    options = dict.fromkeys(root.attrs["processing_options"] for root in roots.values())
    return Contents(
        title=title,
        summary=[
            f"{counted(len(roots), 'position')} and {counted(table.sizes['mpc'], 'MPC')}. Made by {maker}.",
            *filter(None, [environment.reflectors.attrs.get("empty")]),
        ],
        products=roots,
        table=table,
        located=located,
        environment=environment,
        parameters=parameters,
        statistics=campaign_statistics(parameters),
        failures=list(dict.fromkeys([*failures, *unusable])),
        notes=[*warnings(environment), *notes_on_parameters(parameters)],
        settings=[
            ("processing", ", ".join(f"{name} {cell(value)}" for name, value in parse_json(one).items()))
            for one in options
        ],
    )


def _root(path: Path) -> xr.Dataset:
    """Root of a product that tells where it comes from."""
    root = open_group(path)
    for name in (*TABLES, *(f"{kind}_directions" for kind in ("recorded", "missing", "problem"))):
        if name not in root.attrs:
            raise DataError(f"{path}: has no {name}; expected {PRODUCT}")
    for name in TABLES:
        try:
            found = parse_json(str(root.attrs[name]))
        except ValueError:
            found = None
        if not isinstance(found, dict):
            raise DataError(f"{path}: {name} is {shortened(root.attrs[name])}; expected a table in JSON")
    return root
