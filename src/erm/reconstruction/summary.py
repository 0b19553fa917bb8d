"""Why components are not on a map, in a line for each thing that a user may want to know."""

from typing import TYPE_CHECKING

import numpy as np

from erm.common.console import counted
from erm.mpcs.reasons import count_reasons

if TYPE_CHECKING:
    import xarray as xr


def left_out(merged: "xr.Dataset", min_support: int = 3) -> list[str]:
    """Say why components are on no reflector, and why there is none if there is none.

    Parameters
    ----------
    merged : xarray.Dataset
        Table of `erm.reconstruction.reconstruct.reconstruct`.
    min_support : int
        Antenna pairs that must share a wall.
    """
    if not merged.sizes["mpc"]:
        return ["no components: nothing arrived that could tell of a wall"]
    counts = count_reasons(merged["reason"].values[~merged["accepted"].values].tolist())
    causes = [f"{reason.text} ({count})" for reason, count in counts.items()]
    lines = [f"left out: {', '.join(causes)}"] if causes else []
    pairs = len(np.unique(merged["link"].values))
    if pairs < min_support and not merged["accepted"].values.any():
        lines.append(f"{counted(pairs, 'antenna pair')}: a wall needs paths of {min_support} or more that share it")
    return lines
