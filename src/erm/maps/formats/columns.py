"""An environment as flat columns and properties of the whole scene: what every map format stores."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from erm.common.errors import DataError
from erm.common.storage import provenance
from erm.maps.environment import Environment, Slab
from erm.maps.georeference import Georeference
from erm.maps.materials import Material
from erm.maps.reflectors import DEFAULT_MATERIAL, make_reflectors

if TYPE_CHECKING:
    import xarray as xr

Columns = dict[str, np.ndarray]

ENDS = ("first_east", "first_north", "second_east", "second_north")
COVARIANCES = {
    "normal_variance": ("covariance", 0, 0),
    "normal_offset_covariance": ("covariance", 0, 1),
    "offset_variance": ("covariance", 1, 1),
    "east_variance": ("centre_covariance", 0, 0),
    "east_north_covariance": ("centre_covariance", 0, 1),
    "north_variance": ("centre_covariance", 1, 1),
}
"""Variable, row and column of each column of a covariance."""
UNSEEN = ("first_unseen", "second_unseen")
CENTRE = ("centre_east", "centre_north")
NUMBERS = ("radius", "radius_std", "base", "top", "normal", "offset", "residual", "relief", "tilt")
DEFAULTS: Mapping[str, object] = {
    "kind": "wall", "radius": 0.0, "base": 0.0, "top": np.inf, "normal": np.nan, "offset": np.nan,
    **dict.fromkeys(COVARIANCES, np.nan), "support": 0, "residual": np.nan, "material": DEFAULT_MATERIAL,
    **dict.fromkeys((*CENTRE, *UNSEEN, "radius_std", "relief", "tilt"), np.nan),
}  # fmt: skip
"""Values of columns that a hand-made file leaves out."""
MISSING: Mapping[str, float] = {"radius": 0.0, "base": -np.inf, "top": np.inf, "support": 0.0}
"""Values of missing numbers (JSON null, empty cell) in columns that exist."""


def to_columns(reflectors: "xr.Dataset") -> Columns:
    """Flatten the reflector table to columns (reflector,)."""
    ends = reflectors.end_points.values.reshape(-1, 4)
    columns: Columns = {"kind": reflectors.kind.values.astype(str)}
    columns |= {name: ends[:, i] for i, name in enumerate(ENDS)}
    for name in DEFAULTS:
        if name in COVARIANCES:
            variable, row, column = COVARIANCES[name]
            columns[name] = reflectors[variable].values[:, row, column]
        elif name in CENTRE:
            columns[name] = reflectors.centre.values[:, CENTRE.index(name)]
        elif name in UNSEEN:
            columns[name] = reflectors.unseen.values[:, UNSEEN.index(name)]
        else:
            columns[name] = reflectors[name].values
    return columns


def to_scene(environment: Environment) -> dict[str, Any]:
    """Ground, ceiling, materials and provenance, ready for JSON."""
    return {
        "attributes": provenance("Environment", "erm.write_map") | dict(environment.reflectors.attrs),
        "ground": environment.ground and asdict(environment.ground),
        "ceiling": environment.ceiling and asdict(environment.ceiling),
        "materials": [material.to_dict() for material in environment.materials.values()],
        "georeference": environment.georeference and asdict(environment.georeference),
    }


def to_environment(columns: Columns, scene: Mapping[str, Any]) -> Environment:
    """Make an environment from the results of `to_columns` and `to_scene`; missing columns get their defaults."""
    if absent := [name for name in ENDS if name not in columns]:
        raise DataError(f"no column {absent[0]}; expected {', '.join(ENDS)}")
    count = len(columns[ENDS[0]])
    ends = np.stack([number(columns, name, count) for name in ENDS], axis=-1).reshape(-1, 2, 2)
    matrices = {variable: np.empty((count, 2, 2)) for variable, _, _ in COVARIANCES.values()}
    for name, (variable, row, column) in COVARIANCES.items():
        matrices[variable][:, row, column] = matrices[variable][:, column, row] = number(columns, name, count)
    numbers = {name: number(columns, name, count) for name in NUMBERS}
    words = {name: _words(columns.get(name, [DEFAULTS[name]] * count), name) for name in ("kind", "material")}
    table = make_reflectors(
        ends,
        centre=np.stack([number(columns, name, count) for name in CENTRE], axis=-1),
        unseen=np.stack([number(columns, name, count) for name in UNSEEN], axis=-1),
        **matrices,
        support=_counts(columns, "support", count),
        **numbers,
        **words,
    )
    try:
        table.attrs = dict(scene.get("attributes") or {})
        materials = [Material.from_dict(values) for values in scene.get("materials") or ()]
        ground, ceiling = (
            Slab(float(values["height"]), str(values.get("material", DEFAULT_MATERIAL))) if values else None
            for values in (scene.get("ground"), scene.get("ceiling"))
        )
    except DataError:
        raise
    except (TypeError, ValueError, KeyError, AttributeError) as error:
        raise DataError(f"ground, ceiling or materials are malformed ({error})") from error
    place = scene.get("georeference")
    frame = Georeference.from_dict(place) if place is not None else None
    return Environment(table, ground, ceiling, {material.name: material for material in materials}, frame)


def _words(cells: Any, name: str) -> np.ndarray:
    if any(isinstance(cell, (list, dict)) for cell in cells):
        raise DataError(f"{name} holds lists; expected a word for each reflector")
    return np.asarray(cells, dtype=str)


def _counts(columns: Columns, name: str, count: int) -> np.ndarray:
    values = number(columns, name, count)
    if not (np.abs(values) <= np.iinfo(np.int32).max).all():
        row = int(np.argmin(np.abs(values) <= np.iinfo(np.int32).max))
        raise DataError(f"column {name} is {values[row]:g} in row {row + 1}; expected a number of paths")
    return values.astype(np.int64)


def number(columns: Columns, name: str, count: int) -> np.ndarray:
    """Column of numbers; missing columns and cells get the values of `DEFAULTS` and `MISSING`."""
    if name not in columns:
        return np.full(count, DEFAULTS[name], dtype=float)
    if np.iscomplexobj(columns[name]):
        raise DataError(f"column {name} holds complex numbers; expected real ones")
    try:
        values = np.array([np.nan if cell in (None, "") else cell for cell in columns[name]], dtype=float)
    except (TypeError, ValueError) as error:
        raise DataError(f"column {name}: {error}; expected numbers") from error
    if name not in ("base", "top") and np.isinf(values).any():
        raise DataError(f"column {name} is infinite in row {int(np.argmax(np.isinf(values))) + 1}; expected numbers")
    return np.where(np.isnan(values), MISSING.get(name, np.nan), values)
