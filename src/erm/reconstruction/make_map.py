"""From an MPC table to a map with its provenance: what ``erm reconstruct`` and ``sounder run`` do in between."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from erm.common.constants import c
from erm.common.storage import provenance
from erm.maps.environment import Environment
from erm.mpcs.options import Threshold
from erm.reconstruction.model.paths import IntArray
from erm.reconstruction.rounds import reconstruct_survey
from erm.reconstruction.summary import explain_unused
from erm.survey.bundle import SurveyStd
from erm.survey.calibration import apply, calibrate, refined
from erm.survey.conventions import contradictions, offsets
from erm.survey.report import attributes

if TYPE_CHECKING:
    import xarray as xr


def make_map(
    table: "xr.Dataset",
    *,
    history: str,
    inputs: Iterable[Path] = (),
    start: IntArray | None = None,
    threshold: Threshold = "consistency",
    max_reflection_loss: float | None = None,
    min_support: int = 3,
    ground_height: float = 0.0,
    rx_std: float | None = None,
    heading_std: float | None = None,
    clock_std: float | None = None,
    as_given: bool = False,
) -> tuple[Environment, "xr.Dataset"]:
    """Calibrate, select single reflections, reconstruct the map, and store its provenance in it.

    Parameters
    ----------
    table : xarray.Dataset
        MPC table (`erm.make_table`).
    history : str
        The command or function that makes the map. It is stored in the map.
    inputs : iterable of path
        Files that the table was read from. Their SHA-256 is stored in the map.
    start : array (mpc,) of int, optional
        Common images of an earlier map; see `erm.reconstruct`.
    threshold, max_reflection_loss, ground_height
        Options of `erm.select`.
    rx_std, heading_std, clock_std : float, optional
        Standard errors of each horizontal coordinate of a receiver [m], of the azimuth zero [degree] and of the clock
        [s] of a position. Default: estimated.
    min_support : int
        Fewest antenna pairs that must share a wall.
    as_given : bool
        Take heading, clock and gain as the table gives them, without calibration (`erm.survey.calibration`).

    Returns
    -------
    environment : Environment
        The map; its attributes tell inputs and options, the calibration, and what contradicts
        (`erm.survey.report.attributes`).
    located : xarray.Dataset
        The table of `erm.reconstruct`, with the positions (`erm.survey.position_files`).

    Examples
    --------
    >>> import erm
    >>> from erm.reconstruction.make_map import make_map
    >>> street = erm.Environment.walls([[[-60, 10], [60, 10]]], top=40.0)
    >>> links = [erm.predict(street, (0, 0, 9), (x, -4, 2), 132e9) for x in (10, 14, 18, 22)]
    >>> import xarray as xr
    >>> environment, located = make_map(xr.concat(links, dim="mpc"), history="example")
    >>> environment.reflectors.sizes["reflector"], environment.reflectors.attrs["history"]
    (1, 'example')
    """
    causes = contradictions(table)
    calibration = calibrate(table)
    causes += offsets(table, calibration.ambiguous)
    if not as_given:
        table = apply(table, calibration)
    common = calibration.common and not as_given
    environment, located = reconstruct_survey(
        table,
        SurveyStd(rx_std, heading_std, None if clock_std is None else clock_std * c),
        common=common,
        clocks=[(clock - calibration.applied["clock"]) * c for clock in calibration.clocks] if common else (),
        clock_doubt=calibration.clock_doubt * c,
        min_support=min_support,
        start=start,
        threshold=threshold,
        max_reflection_loss=max_reflection_loss,
        ground_height=ground_height,
    )
    options = {
        "threshold": threshold,
        "max_reflection_loss": max_reflection_loss,
        "min_support": min_support,
        "ground_height": ground_height,
        "rx_std": rx_std,
        "heading_std": heading_std,
        "clock_std": clock_std,
        "as_given": as_given,
    }
    origin = provenance("Reconstructed environment", history, inputs=inputs, options=options)
    environment.reflectors.attrs.update(
        origin | attributes(refined(calibration, located), causes, located, as_given=as_given)
    )
    if not environment.reflectors.sizes["reflector"]:
        environment.reflectors.attrs["empty"] = "; ".join(explain_unused(located, min_support))
    return environment, located
