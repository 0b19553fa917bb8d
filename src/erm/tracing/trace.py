"""Forward model: all specular paths in an environment, up to a number of reflections."""

from typing import TYPE_CHECKING, get_args

import numpy as np
from numpy.typing import ArrayLike

from erm.common.constants import FARTHEST, c
from erm.common.errors import DataError
from erm.maps.environment import CEILING, GROUND, NO_BOUNCE, Environment
from erm.tracing.cylinders import CylinderPaths, cylinders_of, double_bounces, single_bounces
from erm.tracing.faces import faces_of
from erm.tracing.image_method import polyline, sequences, specular_paths
from erm.tracing.obstacles import Obstacles, obstacles_of
from erm.tracing.propagation import Polarization, path_coefficients

if TYPE_CHECKING:
    import xarray as xr


def trace(
    environment: Environment,
    tx: ArrayLike,
    rx: ArrayLike,
    frequency: float,
    *,
    max_order: int = 3,
    polarization: Polarization = "vertical",
    obstacles: Environment | None = None,
    max_cylinder_order: int = 1,
) -> "xr.Dataset":
    """Find the direct path and all specular paths between two isotropic antennas.

    The image method is applied to walls, ground and ceiling. Both sides of a wall reflect; nothing passes through it.
    Poles and arcs add paths with a single reflection, and with one off a flat face before or after it, exact by
    Fermat's principle (`erm.geometry.cylinders`); arcs block, poles do not. `path_coefficients` and, for curved faces,
    `erm.geometry.cylinders.spreading_factor` give the amplitudes.

    Parameters
    ----------
    environment : Environment
    tx, rx : array (3,)
        Positions, east/north/up [m].
    frequency : float
        Carrier frequency [Hz].
    max_order : int
        Largest number of reflections of a path.
    polarization : {"vertical", "horizontal"}
        Polarisation of both antennas.
    obstacles : Environment, optional
        Walls and arcs that block paths; default: those of the environment. Give both if walls may extend further than
        is known: the possible walls then reflect, and only the known ones block.
    max_cylinder_order : {1, 2}
        Largest number of reflections of a path that meets a pole or an arc.

    Returns
    -------
    xarray.Dataset
        Dimension ``path``, possibly of length 0, sorted by delay: ``delay`` [s]; ``azimuth``, ``elevation``,
        ``departure_azimuth``, ``departure_elevation`` [degree]; complex ``coefficient``; ``path_gain`` [dB]; ``order``,
        the number of reflections; ``los``, true for the direct path; reflection points ``vertices`` (path, bounce, xyz)
        [m] from transmitter to receiver, padded with NaN; ``reflector`` (path, bounce), index in the reflectors of the
        environment, -1 for the ground, -2 for the ceiling, -3 for padding.

    Raises
    ------
    DataError
        The antennas are at one place, or an argument is out of range.

    Examples
    --------
    >>> import erm
    >>> from erm.maps.environment import Slab
    >>> street = erm.Environment.walls([[[-60, 10], [60, 10]]], top=40.0, ground=Slab(0.0))
    >>> paths = erm.trace(street, (0, 0, 9), (20, -4, 2), 132e9, max_order=1)
    >>> paths["reflector"].values.tolist()  # direct path, ground, wall
    [[-3], [-1], [0]]
    >>> (paths["delay"].values * 1e9).round(1).tolist()
    [71.9, 77.3, 106.8]
    """
    here, there = _position("tx", tx), _position("rx", rx)
    if np.array_equal(here, there):
        raise DataError(f"tx and rx are both at {here.tolist()} m; expected two different positions")
    if not (np.isfinite(frequency) and frequency > 0):
        raise DataError(f"frequency {frequency} Hz; expected a positive number")
    if polarization not in get_args(Polarization):
        raise DataError(f"polarization {polarization!r}; expected one of {', '.join(get_args(Polarization))}")
    if max_order < 0:
        raise DataError(f"max_order {max_order}; expected 0 or more")
    if max_cylinder_order not in (1, 2):
        raise DataError(f"max_cylinder_order {max_cylinder_order}; expected 1 or 2")

    faces = faces_of(environment)
    blocking = obstacles_of(environment if obstacles is None else obstacles)
    found = [_direct(blocking, here, there)]
    cylinders = cylinders_of(environment)
    bent = [single_bounces(cylinders, here, there)] if max_order else []
    if min(max_order, max_cylinder_order) > 1:
        bent += double_bounces(cylinders, faces, here, there)
    found += [_unblocked(paths, blocking, here, there) for paths in bent]
    for candidates in sequences(faces, here, max_order):
        vertices, face = specular_paths(faces, here, there, candidates, blocking)
        found.append((vertices, faces.label[face], faces.normal[face], None))
    parts = [_paths(environment, here, there, frequency, polarization, *group) for group in found if len(group[0])]
    return _table(parts, max_order, frequency)


Group = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray | None]  # vertices, reflector, normal, spreading


def _direct(blocking: Obstacles, tx: np.ndarray, rx: np.ndarray) -> Group:
    visible = int(blocking.leave_free(tx[None], rx[None])[0])
    return np.empty((visible, 0, 3)), np.empty((visible, 0), dtype=int), np.empty((visible, 0, 3)), None


def _unblocked(paths: CylinderPaths, blocking: Obstacles, tx: np.ndarray, rx: np.ndarray) -> Group:
    route = polyline(tx, paths.vertices, rx)
    free = blocking.leave_free(route[:, :-1], route[:, 1:]).all(axis=-1)
    return paths.vertices[free], paths.reflector[free], paths.normal[free], paths.spreading[free]


def _paths(
    environment: Environment,
    tx: np.ndarray,
    rx: np.ndarray,
    frequency: float,
    polarization: Polarization,
    vertices: np.ndarray,
    reflector: np.ndarray,
    normal: np.ndarray,
    spreading: np.ndarray | None,
) -> dict[str, np.ndarray]:
    """Columns of the paths of one order."""
    permittivity, height_deviation = _surfaces(environment, reflector, frequency)
    route = polyline(tx, vertices, rx)
    legs = np.diff(route, axis=1)
    departure_azimuth, departure_elevation = _angles(legs[:, 0])
    azimuth, elevation = _angles(-legs[:, -1])
    return {
        "delay": np.linalg.norm(legs, axis=-1).sum(-1) / c,
        "azimuth": azimuth,
        "elevation": elevation,
        "departure_azimuth": departure_azimuth,
        "departure_elevation": departure_elevation,
        "coefficient": path_coefficients(
            route,
            normal,
            permittivity,
            height_deviation,
            frequency,
            polarization=polarization,
            spreading=spreading,
        ),
        "vertices": vertices,
        "reflector": reflector,
    }


def _surfaces(environment: Environment, reflector: np.ndarray, frequency: float) -> tuple[np.ndarray, np.ndarray]:
    """Permittivity and height deviation of the reflectors (path, bounce)."""
    names = dict(enumerate(environment.reflectors.material.values.tolist()))
    names |= {
        tag: slab.material for tag, slab in ((GROUND, environment.ground), (CEILING, environment.ceiling)) if slab
    }
    distinct, place = np.unique(reflector, return_inverse=True)
    used = [environment.materials[names[tag]] for tag in distinct.tolist()]
    permittivity = np.array([material.relative_permittivity(frequency) for material in used], dtype=complex)
    deviation = np.array([material.height_deviation for material in used])
    shape = reflector.shape
    return permittivity[place].reshape(shape), deviation[place].reshape(shape)


def _angles(direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Azimuth in [0, 360) and elevation [degree]."""
    azimuth = np.degrees(np.arctan2(direction[:, 1], direction[:, 0])) % 360
    return azimuth, np.degrees(np.arctan2(direction[:, 2], np.hypot(direction[:, 0], direction[:, 1])))


def _position(name: str, value: ArrayLike) -> np.ndarray:
    position = np.asarray(value, dtype=float)
    if position.shape != (3,) or not (np.abs(position) < FARTHEST).all():
        raise DataError(
            f"{name} is {np.asarray(value).tolist()}; expected three numbers of a place on earth, east, north, up [m]"
        )
    return position


def _table(parts: list[dict[str, np.ndarray]], max_order: int, frequency: float) -> "xr.Dataset":
    """Table of the paths of all orders, sorted by delay."""
    import xarray as xr

    def column(name: str, dtype: type = float) -> np.ndarray:
        return np.concatenate([np.empty(0, dtype), *(part[name] for part in parts)])

    def padded(name: str, fill: float, dtype: type, *tail: int) -> np.ndarray:
        blocks: list[np.ndarray] = [np.full((0, max_order, *tail), fill, dtype=dtype)]
        for part in parts:
            block: np.ndarray = np.full((len(part["delay"]), max_order, *tail), fill, dtype=dtype)
            block[:, : part[name].shape[1]] = part[name]
            blocks.append(block)
        return np.concatenate(blocks)

    delay = column("delay")
    rank = np.argsort(delay, kind="stable")
    coefficient = column("coefficient", complex)
    reflector = padded("reflector", NO_BOUNCE, np.int64)
    order = (reflector != NO_BOUNCE).sum(axis=1)
    with np.errstate(divide="ignore"):  # a path may be entirely cross-polarised: -inf dB
        gain = 20 * np.log10(np.abs(coefficient))
    columns = {
        "delay": (("path",), delay, "s", "propagation delay"),
        "azimuth": (("path",), column("azimuth"), "degree", "azimuth of arrival"),
        "elevation": (("path",), column("elevation"), "degree", "elevation of arrival"),
        "departure_azimuth": (("path",), column("departure_azimuth"), "degree", "azimuth of departure"),
        "departure_elevation": (("path",), column("departure_elevation"), "degree", "elevation of departure"),
        "coefficient": (("path",), coefficient, "1", "baseband amplitude"),
        "path_gain": (("path",), gain, "dB", "path gain"),
        "order": (("path",), order, "1", "number of reflections"),
        "los": (("path",), order == 0, "1", "direct path"),
        "vertices": (("path", "bounce", "xyz"), padded("vertices", np.nan, float, 3), "m", "reflection points"),
        "reflector": (("path", "bounce"), reflector, "1", "reflector of each reflection point"),
    }
    return xr.Dataset(
        {
            name: (dims, values[rank], {"units": units, "long_name": text})
            for name, (dims, values, units, text) in columns.items()
        },
        attrs={"frequency": float(frequency)},
    )
