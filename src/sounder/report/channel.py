"""Channel parameters and fits of path loss for the tables and charts of the page."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from sounder.parameters.catalogue import PARAMETERS, READ_IN
from sounder.parameters.statistics import FITS, Statistic
from sounder.report.numbers import rounded


def parameter_columns(parameters: xr.Dataset) -> list[dict[str, Any]]:
    """Parameters that are known of any position, in the order of the table of positions.

    Returns
    -------
    list of dict
        ``name``, ``unit`` and ``definition`` in words; ``values`` and ``errors`` (standard deviations; empty if not
        known).
    """
    found = []
    for name, about in PARAMETERS.items():
        if name not in parameters or not np.isfinite(parameters[name].values).any():
            continue
        scale, unit = READ_IN.get(about.unit, (1.0, about.unit))
        std = f"{name}_std"
        found.append(
            {
                "key": name,
                "name": about.text,
                "unit": unit,
                "definition": about.definition,
                "values": rounded(parameters[name].values * scale, 3),
                "errors": rounded(parameters[std].values * scale, 3) if std in parameters else [],
            }
        )
    return found


def fits(statistics: Sequence[Statistic]) -> list[dict[str, Any]]:
    """Fits of path loss: ``group``, ``model``, ``intercept`` [dB] and ``exponent`` of each."""
    known = {(one.group, one.parameter, one.statistic): one.value for one in statistics}
    groups = dict.fromkeys(one.group for one in statistics)
    found = []
    for group in groups:
        for model in FITS:
            pair = [known.get((group, model, part)) for part in ("intercept", "exponent")]
            if None not in pair:
                name = model.removeprefix("path_loss_").replace("_", " ")
                found.append({"group": group, "model": name, "intercept": pair[0], "exponent": pair[1]})
    return found
