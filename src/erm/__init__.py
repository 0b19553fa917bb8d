"""Environment reconstruction: from multipath components (MPCs) to a map of the walls that reflected them, and back.

From MPCs to a map, and from the map to MPCs at a new place::

    import erm

    table, problems = erm.read_mpcs(["mpcs.csv"])  # CSV files and products of `sounder process`
    environment, located = erm.reconstruct(erm.select(table))  # single bounces -> walls and poles
    erm.write_map(environment, "map.geojson")
    erm.plot_map(environment, table=located).figure.savefig("map.png")
    predicted = erm.predict(environment, (0, 0, 28.4), (31, -60, 1.4), 132e9)

How good a map is: `evaluate_walls`, `evaluate_mpcs` and `completeness` compare it with a known outline;
`leave_one_out` predicts each measured position from all others; `explain` names the reflectors of each MPC.
Draw an environment with `Environment.walls`, find all its paths with `trace`.

Positions are east/north/up [m], azimuths degrees counter-clockwise from east, delays seconds, gains dB.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from erm.common.version import __version__

if TYPE_CHECKING:
    from erm.common.errors import DataError, OptionError
    from erm.evaluation.completeness import completeness
    from erm.evaluation.explain import explain
    from erm.evaluation.leave_one_out import leave_one_out
    from erm.evaluation.outline import evaluate_mpcs, evaluate_walls
    from erm.figures.maps import plot_map
    from erm.maps.environment import Environment
    from erm.maps.formats import read_map, write_map
    from erm.maps.georeference import Georeference
    from erm.maps.materials import Material
    from erm.mpcs.files import read_mpcs, write_mpcs
    from erm.mpcs.selection import select
    from erm.mpcs.table import make_table
    from erm.reconstruction.reconstruct import reconstruct
    from erm.tracing.predict import predict
    from erm.tracing.trace import trace

_MODULES = {
    "DataError": "erm.common.errors",
    "Environment": "erm.maps.environment",
    "Georeference": "erm.maps.georeference",
    "Material": "erm.maps.materials",
    "OptionError": "erm.common.errors",
    "completeness": "erm.evaluation.completeness",
    "evaluate_mpcs": "erm.evaluation.outline",
    "evaluate_walls": "erm.evaluation.outline",
    "explain": "erm.evaluation.explain",
    "leave_one_out": "erm.evaluation.leave_one_out",
    "make_table": "erm.mpcs.table",
    "plot_map": "erm.figures.maps",
    "predict": "erm.tracing.predict",
    "read_map": "erm.maps.formats",
    "read_mpcs": "erm.mpcs.files",
    "reconstruct": "erm.reconstruction.reconstruct",
    "select": "erm.mpcs.selection",
    "trace": "erm.tracing.trace",
    "write_map": "erm.maps.formats",
    "write_mpcs": "erm.mpcs.files",
}
"""Module of each public name. It is imported when the name is first used, so that ``import erm`` stays fast."""

__all__ = [
    "DataError",
    "Environment",
    "Georeference",
    "Material",
    "OptionError",
    "__version__",
    "completeness",
    "evaluate_mpcs",
    "evaluate_walls",
    "explain",
    "leave_one_out",
    "make_table",
    "plot_map",
    "predict",
    "read_map",
    "read_mpcs",
    "reconstruct",
    "select",
    "trace",
    "write_map",
    "write_mpcs",
]


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(_MODULES[name]), name)
    return value


def __dir__() -> list[str]:
    return __all__
