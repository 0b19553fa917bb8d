"""Summary for people: why MPCs are not on the map."""

from typing import TYPE_CHECKING

import numpy as np

from erm.common.console import counted
from erm.mpcs.reasons import OF_RECONSTRUCTION, count_reasons

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
    return lines if located["accepted"].values.any() else [*lines, _why_empty(located, min_support)]


def _why_empty(located: "xr.Dataset", min_support: int) -> str:
    """Return a line that says why no MPC is on a reflector."""
    reason, image = located["reason"].values, located["image"].values
    pairs = len(np.unique(located["link"].values))
    single = int(np.isin(reason, OF_RECONSTRUCTION).sum())
    if single and pairs < min_support:
        return f"{counted(pairs, 'antenna pair')}: a wall needs paths of at least {min_support}"
    all_mpcs = f"{counted(len(reason), 'MPC')} of {counted(pairs, 'antenna pair')}"
    text = f"no reflector: {single} of {all_mpcs} may be single reflections"
    if not single:
        return text
    shared, size = np.unique(image[image >= 0], return_counts=True)
    if not len(shared):
        return f"{text}, no {min_support} of them off one wall"
    own = count_reasons(reason[image == shared[np.argmax(size)]].tolist())
    why = ", ".join(f"{cause.text} ({count})" for cause, count in own.items())
    found = counted(len(shared), "common image")
    return f"{text}; of {found} the largest has {size.max()} of them: {why}"
