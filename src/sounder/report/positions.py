"""What the page shows of each position."""

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from erm.common.storage import open_groups, require_axes
from sounder.processing.summary_texts import line_of_sight
from sounder.quality.table import read_remarks
from sounder.remark import lines
from sounder.report.numbers import ellipse, rounded
from sounder.report.spectra import reduce_daps, reduce_pdp


def describe_position(product: Path, root: xr.Dataset, located: xr.Dataset) -> dict[str, Any]:
    """One position: where it is, what is wrong with it, its DAPS and PDP.

    Parameters
    ----------
    product : Path
    root : xarray.Dataset
        Root group of the product.
    located : xarray.Dataset
        MPCs of all positions; errors of the positions too, if they were adjusted.

    Returns
    -------
    dict
    """
    name = str(root["position"].item())
    quality, daps, mpc = open_groups(product, "/quality", "/daps", "/mpc")
    scan = ("azimuth", "elevation")
    axes = {"daps": (*scan, "delay"), "noise_floor": scan, "pdp": ("delay",)}
    require_axes(daps, product, axes | {name: (name,) for name in (*scan, "delay")})
    remarks, recorded = read_remarks(quality), int(root.attrs["recorded_directions"])
    tx, rx = (root[f"{end}_position"].values[0] for end in ("tx", "rx"))
    return {
        "name": name,
        "file": product.name,
        "los": line_of_sight(int(root.attrs["los"])),
        "tx": rounded(tx, 3),
        "rx": rounded(rx, 3),
        "distance": rounded(np.linalg.norm(tx - rx), 3),
        "ellipse": _error(name, located),
        "failures": lines(remarks, recorded, failures=True),
        "notes": lines(remarks, recorded, failures=False),
        "missing": int(root.attrs["missing_directions"]),
        "problems": int(root.attrs["problem_directions"]),
        "daps": reduce_daps(daps),
        "pdp": reduce_pdp(daps, mpc),
    }


def _error(name: str, located: xr.Dataset) -> list[float] | None:
    """Ellipse of the error of a position that was adjusted."""
    if "survey_name" not in located:
        return None
    rows = np.flatnonzero(located["survey_name"].values.astype(str) == name)
    return ellipse(located["survey_covariance"].values[rows[0], :2, :2]) if rows.size else None
