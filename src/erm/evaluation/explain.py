"""Which reflectors of a map explain the components that a position received."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from erm.geometry.vertical import FloatArray, angle_difference
from erm.maps.environment import Environment
from erm.tracing.trace import trace

if TYPE_CHECKING:
    import xarray as xr

DELAY_GATE = 1e-9  # s; 0.3 m, about the resolution cell of 1.2 GHz
AZIMUTH_GATE = 5.0  # degree; half a beam
DIRECT, GROUND, CEILING, UNEXPLAINED = "direct", "ground", "ceiling", ""


class Sector(NamedTuple):
    """A range of azimuths in which components of one origin arrive.

    Parameters
    ----------
    name : str
        Of the origin.
    start, stop : float
        Azimuths [degree], counter-clockwise from one to the other; ``stop`` may exceed 360.
    components : int
        How many are in it.
    """

    name: str
    start: float
    stop: float
    components: int


def names_of(environment: Environment) -> list[str]:
    """Short names of a map's reflectors: W for walls, P for poles, and the row of the map's table, from 0.

    The number is the one that ``erm reconstruct`` prints and that ``wall`` holds in an MPC table.
    """
    return [f"{'W' if kind == 'wall' else 'P'}{row}" for row, kind in enumerate(environment.reflectors["kind"].values)]


def bounces_of(label: str) -> int:
    """Number of walls and poles that a label of `explain` names; bounces off ground and ceiling do not count."""
    return len(_met(label))


def origin_of(label: str) -> str:
    """The reflector that the receiver sees: the last of a label of `explain`; ``direct`` where there was none.

    What met only the ground arrives from where the direct path does. What is not explained has no origin.
    """
    if label == UNEXPLAINED:
        return UNEXPLAINED
    met = _met(label)
    return met[-1] if met else DIRECT


def _met(label: str) -> list[str]:
    return [name for name in label.split("+") if name not in (UNEXPLAINED, DIRECT, GROUND, CEILING)]


def explain(table: "xr.Dataset", environment: Environment, *, max_order: int = 2) -> npt.NDArray[np.str_]:
    """Name the reflectors of a map that each component met, in the order from TX to RX.

    Every link is traced through the map; a component is explained by the path that is nearest to it in delay and
    azimuth within `DELAY_GATE` and `AZIMUTH_GATE`. Where two are equally near, the one of fewer bounces wins.

    Parameters
    ----------
    table : xarray.Dataset
        MPC table (`erm.mpcs.table`).
    environment : Environment
        Of `erm.reconstruction.reconstruct`; or any other.
    max_order : int
        Largest number of bounces.

    Returns
    -------
    array (mpc,) of str
        ``direct``, ``ground``, ``W3``, ``W3+W5``; empty where the map explains nothing.
    """
    names = np.array([*names_of(environment), CEILING, GROUND])  # -2 and -1 of `trace`
    labels = np.full(table.sizes["mpc"], UNEXPLAINED, dtype=object)
    ends = np.hstack([table["tx_position"].values, table["rx_position"].values])
    for link in np.unique(ends, axis=0):
        rows = np.flatnonzero((ends == link).all(axis=1))
        paths = trace(environment, link[:3], link[3:], float(table["frequency"].values[rows[0]]), max_order=max_order)
        if paths.sizes["path"] == 0:
            continue
        late = (table["delay"].values[rows, None] - paths["delay"].values) / DELAY_GATE
        turned = angle_difference(table["azimuth"].values[rows, None], paths["azimuth"].values) / AZIMUTH_GATE
        apart = np.hypot(late, turned)
        order = paths["order"].values
        nearest = np.argmin(np.round(apart, 1) + 1e-3 * order, axis=1)
        near = apart[np.arange(len(rows)), nearest] < 1
        for row, path in zip(rows[near], nearest[near], strict=True):
            met = paths["reflector"].values[path, : order[path]]
            labels[row] = "+".join(names[met].tolist()) or DIRECT
    return labels.astype(np.str_)


def sectors(
    azimuth: FloatArray, labels: Sequence[str] | npt.NDArray[np.str_], *, margin: float = 5.0, gap: float = 30.0
) -> list[Sector]:
    """Ranges of azimuth of the components of one label each.

    Parameters
    ----------
    azimuth : array (mpc,)
        [degree].
    labels : sequence of str
        From `origin_of`, or `explain` itself; unexplained ones are left out.
    margin : float
        Added on either side, half a beam [degree].
    gap : float
        Components of one label further apart than this make two sectors [degree].

    Returns
    -------
    list of Sector
        By name, and of one name counter-clockwise from the end of its widest gap.
    """
    found: list[Sector] = []
    labels = np.asarray(labels)
    for name in sorted(set(labels.tolist()) - {UNEXPLAINED}):
        turned = np.sort(azimuth[labels == name] % 360)
        free = np.diff(np.append(turned, turned[0] + 360))
        around = np.roll(np.arange(len(turned)), -int(np.argmax(free)) - 1)  # starts after the widest gap
        ordered = np.unwrap(turned[around], period=360)
        for run in np.split(ordered, np.flatnonzero(np.diff(ordered) > gap) + 1):
            start = float(run[0] % 360)
            found.append(Sector(name, start - margin, start + float(run[-1] - run[0]) + margin, len(run)))
    return found
