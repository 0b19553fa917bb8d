"""Channels of few paths, as tables of MPCs."""

import numpy as np
import xarray as xr

from sounder.parameters.position import position_parameters
from sounder.parameters.selection import select_mpcs

COLUMNS = ("delay", "azimuth", "elevation", "path_gain")


def table(*paths, std=None, **more) -> xr.Dataset:
    """MPCs of paths (delay [s], azimuth, elevation [degree], gain [dB]), each with the deviations ``std``."""
    values = np.array(paths, float).reshape(-1, 4)
    columns = {name: ("mpc", values[:, i]) for i, name in enumerate(COLUMNS)}
    if std is not None:
        columns |= {f"{name}_std": ("mpc", np.full(len(values), one)) for name, one in zip(COLUMNS, std, strict=True)}
    return xr.Dataset(columns | {name: ("mpc", np.asarray(value)) for name, value in more.items()})


def random_table(rng, count, std=None) -> xr.Dataset:
    return table(
        *np.column_stack(
            [
                rng.uniform(100e-9, 800e-9, count),
                rng.uniform(0, 360, count),
                rng.uniform(-15, 15, count),
                rng.uniform(-130, -100, count),
            ]
        ),
        std=std,
    )


def parameters(mpcs, **options) -> xr.Dataset:
    return position_parameters(select_mpcs(mpcs), **({"distance": 30.0} | options))
