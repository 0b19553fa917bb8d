"""Explanation of MPCs: the reflectors of a map that each MPC met."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from erm.geometry.vertical import FloatArray, angle_difference
from erm.maps.environment import Environment
from erm.tracing.trace import trace

if TYPE_CHECKING:
    import xarray as xr

DIRECT, UNEXPLAINED = "direct", ""
"""Labels of the direct path, and of MPCs that the map does not explain."""
SLABS = ("ceiling", "ground")
"""Names of the reflectors -2 and -1 of `erm.trace`."""


class Sector(NamedTuple):
    """A range of azimuths of the MPCs with one label.

    Parameters
    ----------
    name : str
        The label.
    start, stop : float
        Azimuths [degree], counter-clockwise from start to stop; ``stop`` may exceed 360.
    components : int
        Number of MPCs in the range.
    """

    name: str
    start: float
    stop: float
    components: int


def reflector_names(environment: Environment) -> list[str]:
    """Short names of the reflectors of a map: W (wall), P (pole) or A (arc) and the row in the table, from 0.

    ``erm reconstruct`` prints the same numbers, and the column ``wall`` of an MPC table holds them.
    """
    return [f"{kind[0].upper()}{row}" for row, kind in enumerate(environment.reflectors["kind"].values)]


def count_reflectors(label: str) -> int:
    """Number of walls and poles in a label of `explain`; ground and ceiling do not count."""
    return len(_walls_and_poles(label))


def last_reflector(label: str) -> str:
    """Last wall or pole in a label of `explain`, which the receiver sees.

    It is ``direct`` if the MPC met none, or only ground and ceiling, and empty if the MPC is not explained.
    """
    if label == UNEXPLAINED:
        return UNEXPLAINED
    met = _walls_and_poles(label)
    return met[-1] if met else DIRECT


def _walls_and_poles(label: str) -> list[str]:
    return [name for name in label.split("+") if name not in (UNEXPLAINED, DIRECT, *SLABS)]


def explain(
    table: "xr.Dataset",
    environment: Environment,
    *,
    max_order: int = 2,
    delay_gate: float = 1e-9,
    azimuth_gate: float = 5.0,
) -> npt.NDArray[np.str_]:
    """Name the reflectors that each MPC met, in the order from TX to RX.

    All paths of each link are traced in the map. The path nearest in delay and azimuth explains an MPC, if it lies
    within the ellipse of the gates. Of paths that are equally near, the one with the fewest reflections explains it.

    Parameters
    ----------
    table : xarray.Dataset
        MPC table (`erm.make_table`).
    environment : Environment
        The map.
    max_order : int
        Largest number of reflections of a path.
    delay_gate, azimuth_gate : float
        Half axes of the ellipse [s], [degree]. The defaults are about a resolution cell of 1.2 GHz and half a beam of
        10 degrees.

    Returns
    -------
    array (mpc,) of str
        ``direct``, ``ground``, ``W3``, ``W3+W5``; empty if no path explains the MPC.

    Examples
    --------
    >>> import erm
    >>> street = erm.Environment.walls([[[-60, 10], [60, 10]]], top=40.0)
    >>> mpcs = erm.predict(street, (0, 0, 9), (10, -4, 2), 132e9)
    >>> erm.explain(mpcs, street).tolist()
    ['direct', 'W0']
    """
    names = np.array([*reflector_names(environment), *SLABS])
    labels = np.full(table.sizes["mpc"], UNEXPLAINED, dtype=object)
    ends = np.hstack([table["tx_position"].values, table["rx_position"].values])
    for link in np.unique(ends, axis=0):
        rows = np.flatnonzero((ends == link).all(axis=1))
        paths = trace(environment, link[:3], link[3:], float(table["frequency"].values[rows[0]]), max_order=max_order)
        if paths.sizes["path"] == 0:
            continue
        delay_error = (table["delay"].values[rows, None] - paths["delay"].values) / delay_gate
        azimuth_error = angle_difference(table["azimuth"].values[rows, None], paths["azimuth"].values) / azimuth_gate
        distance = np.hypot(delay_error, azimuth_error)
        order = paths["order"].values
        nearest = np.argmin(np.round(distance, 1) + 1e-3 * order, axis=1)  # prefers few reflections
        near = distance[np.arange(len(rows)), nearest] < 1
        for row, path in zip(rows[near], nearest[near], strict=True):
            met = paths["reflector"].values[path, : order[path]]
            labels[row] = "+".join(names[met].tolist()) or DIRECT
    return labels.astype(np.str_)


def azimuth_sectors(
    azimuth: FloatArray, labels: Sequence[str] | npt.NDArray[np.str_], *, margin: float = 5.0, gap: float = 30.0
) -> list[Sector]:
    """Ranges of azimuth of the MPCs of each label.

    Parameters
    ----------
    azimuth : array (mpc,)
        Azimuths of the MPCs [degree].
    labels : sequence of str
        Labels of `last_reflector` or `explain`; MPCs that are not explained are left out.
    margin : float
        Added to both sides of a range, about half a beam [degree].
    gap : float
        MPCs of one label that are further apart than this make two sectors [degree].

    Returns
    -------
    list of Sector
        Sorted by name; those of one name counter-clockwise from the end of its widest gap.
    """
    found: list[Sector] = []
    labels = np.asarray(labels)
    for name in sorted(set(labels.tolist()) - {UNEXPLAINED}):
        sorted_azimuth = np.sort(azimuth[labels == name] % 360)
        free = np.diff(np.append(sorted_azimuth, sorted_azimuth[0] + 360))
        around = np.roll(np.arange(len(sorted_azimuth)), -int(np.argmax(free)) - 1)  # starts after the widest gap
        ordered = np.unwrap(sorted_azimuth[around], period=360)
        for run in np.split(ordered, np.flatnonzero(np.diff(ordered) > gap) + 1):
            start = float(run[0] % 360)
            found.append(Sector(name, start - margin, start + float(run[-1] - run[0]) + margin, len(run)))
    return found
