"""Everything that a known outline says about a map, in one result."""

from typing import TYPE_CHECKING, Any

from erm.evaluation.completeness import completeness, receivers_of
from erm.evaluation.outline import evaluate_mpcs, evaluate_walls
from erm.geometry.vertical import FloatArray
from erm.maps.environment import Environment

if TYPE_CHECKING:
    import xarray as xr


def evaluate_map(
    environment: Environment, outline: FloatArray, reconstructed: "tuple[Environment, xr.Dataset] | None" = None
) -> dict[str, Any]:
    """Evaluate walls, reflection points and completeness of a map.

    Parameters
    ----------
    environment : Environment
        The map.
    outline : array (segment, 2 ends, 2)
        Known faces [m].
    reconstructed : tuple of Environment and xarray.Dataset, optional
        Result of `erm.reconstruct` of the MPCs whose reflection points are evaluated.

    Returns
    -------
    dict
        ``walls`` of `erm.evaluate_walls`; with ``reconstructed`` also ``points`` of `erm.evaluate_mpcs` and
        ``visible`` of `erm.completeness`, empty without MPCs.

    Examples
    --------
    >>> import erm
    >>> from erm.evaluation.evaluate_map import evaluate_map
    >>> street = erm.Environment.walls([[[-60, 10], [60, 10]]])
    >>> evaluate_map(street, street.reflectors["end_points"].values)["walls"]["found"]
    1
    """
    result: dict[str, Any] = {"walls": evaluate_walls(environment, outline)}
    if reconstructed is not None:
        origin, located = reconstructed
        result["points"] = evaluate_mpcs(located, origin, outline)
        seen = located.sizes["mpc"] > 0
        result["visible"] = completeness(environment, outline, receivers_of(located)) if seen else []
    return result
