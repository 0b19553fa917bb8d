"""Summary for people: why MPCs are not on the map."""

from typing import TYPE_CHECKING

import numpy as np

from erm.common.console import counted
from erm.mpcs.reasons import count_reasons

if TYPE_CHECKING:
    import xarray as xr


def explain_unused(located: "xr.Dataset", min_support: int = 3) -> list[str]:
    """Lines of text that say why MPCs are on no reflector, and why there is no reflector if there is none.

    Parameters
    ----------
    located : xarray.Dataset
        Table of `erm.reconstruct`.
    min_support : int
        Antenna pairs that must share a wall.

    Examples
    --------
    >>> import erm
    >>> street = erm.Environment.walls([[[-60, 10], [60, 10]]], top=40.0)
    >>> _, located = erm.reconstruct(erm.select(erm.predict(street, (0, 0, 9), (10, -4, 2), 132e9, max_order=1)))
    >>> for line in explain_unused(located):
    ...     print(line)
    not on the map: direct path (1), no wall shared with other positions (1)
    1 antenna pair: a wall needs paths of at least 3
    """
    if not located.sizes["mpc"]:
        return ["no MPCs: nothing was received that could locate a wall"]
    counts = count_reasons(located["reason"].values[~located["accepted"].values].tolist())
    causes = [f"{reason.text} ({count})" for reason, count in counts.items()]
    lines = [f"not on the map: {', '.join(causes)}"] if causes else []
    pairs = len(np.unique(located["link"].values))
    if pairs < min_support and not located["accepted"].values.any():
        lines.append(f"{counted(pairs, 'antenna pair')}: a wall needs paths of at least {min_support}")
    return lines
