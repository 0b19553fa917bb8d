"""MPCs that a map predicts between two antennas."""

from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from erm.maps.environment import Environment
from erm.mpcs.table import VALUES, make_table
from erm.tracing.trace import trace

if TYPE_CHECKING:
    import xarray as xr


def predict(
    environment: Environment, tx: ArrayLike, rx: ArrayLike, frequency: float, *, max_order: int = 2
) -> "xr.Dataset":
    """Predict the MPCs between two positions that were not measured.

    Parameters
    ----------
    environment : Environment
        The map.
    tx, rx : array (3,)
        Positions of the antennas, east/north/up [m].
    frequency : float
        Carrier frequency [Hz].
    max_order : int
        Largest number of reflections of a path.

    Returns
    -------
    xarray.Dataset
        MPC table (`erm.make_table`) of one position named ``predicted``, sorted by delay, with ``order`` (mpc,), the
        number of reflections. `erm.trace` returns more of each path: bounce points, reflectors and phases.

    Raises
    ------
    DataError
        Both antennas are at one place, or an argument is out of range.

    Examples
    --------
    >>> import erm
    >>> street = erm.Environment.walls([[[-60, 10], [60, 10]]], top=40.0)
    >>> mpcs = erm.predict(street, (0, 0, 28.4), (31, -60, 1.4), 132e9)
    >>> mpcs["order"].values.tolist(), mpcs["path_gain"].values.round(1).tolist()
    ([0, 1], [-112.1, -121.9])
    """
    paths = trace(environment, tx, rx, frequency, max_order=max_order)
    columns: dict[str, Any] = {"position": "predicted", "tx_position": tx, "rx_position": rx, "frequency": frequency}
    columns |= {"los": int(paths["los"].values.any()), **{name: paths[name].values for name in VALUES}}
    return make_table(columns).assign(order=("mpc", paths["order"].values, paths["order"].attrs))
