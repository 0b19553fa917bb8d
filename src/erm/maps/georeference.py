"""Place of the local frame on earth: a tangent plane of WGS 84, turned by a heading."""

import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from math import cos, isfinite, radians, sin
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from erm.common.errors import DataError, OptionError
from erm.common.optional import require_library
from erm.common.topocentric import MAX_DISTANCE, topocentric
from erm.geometry.vertical import FloatArray

if TYPE_CHECKING:
    from pyproj import Transformer

WGS84 = "OGC:CRS84"
"""Longitude and latitude in WGS 84."""
LOCAL = re.compile(r"(LOCAL_CS|ENGCRS|ENGINEERINGCRS)\b")
"""First word of the WKT of a system without a place on earth."""


@dataclass(frozen=True)
class Georeference:
    """Place and heading of a local frame.

    With ``h`` the heading, a local point ``(x, y, z)`` lies in the topocentric frame of the origin at::

        east  =  x cos h + y sin h
        north = -x sin h + y cos h
        up    =  z

    Geocentric coordinates lead from there to latitude, longitude and ellipsoidal height (EPSG Guidance Note 7-2,
    geocentric/topocentric conversions). The local frame is a plane, not a map projection: distances in it are true,
    and its vertical is that of the origin. At 1 km from the origin the plane is 0.08 m above the ellipsoid, and its
    vertical differs from the plumb line by 0.009 degree.

    Parameters
    ----------
    latitude, longitude : float
        Place of the local (0, 0, 0), WGS 84 [degree].
    height : float
        Height of the local (0, 0, 0) above the ellipsoid, not above the sea [m]. An error of 100 m changes positions
        at 1 km by 16 mm.
    heading : float
        Bearing of the local y axis, degrees clockwise from true north.

    Raises
    ------
    DataError
        A value is not finite or is out of range.

    Examples
    --------
    >>> import erm
    >>> frame = erm.Georeference(48.1, 11.5, heading=90.0)  # local y points east
    >>> longitude, latitude, height = frame.to_geodetic([0.0, 1000.0])
    >>> round(float(longitude), 5), round(float(latitude), 5), round(float(height), 2)
    (11.51343, 48.1, 0.08)
    """

    latitude: float
    longitude: float
    height: float = 0.0
    heading: float = 0.0

    def __post_init__(self) -> None:
        if (
            not all(map(isfinite, asdict(self).values()))
            or abs(self.latitude) > 90
            or abs(self.longitude) > 180
            or abs(self.heading) > 360
        ):
            raise DataError(
                f"origin at latitude {self.latitude} longitude {self.longitude} height {self.height} heading "
                f"{self.heading}; expected degrees: latitudes -90 to 90, longitudes -180 to 180, headings -360 to 360"
            )

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> "Georeference":
        """Make a georeference from the result of ``dataclasses.asdict``; height and heading may be absent."""
        try:
            return cls(**{name: float(value) for name, value in values.items()})
        except DataError:
            raise
        except (TypeError, ValueError, AttributeError) as error:
            raise DataError(
                f"georeference is malformed ({error}); expected latitude, longitude, height and heading"
            ) from error

    def to_geodetic(self, points: ArrayLike) -> FloatArray:
        """Convert local points to longitude, latitude [degree] and ellipsoidal height [m] (..., 3).

        Parameters
        ----------
        points : array (..., 2) or (..., 3)
            Local east, north and optionally up [m]; up is 0 if not given.

        Raises
        ------
        DataError
            pyproj is not installed.
        """
        local = np.asarray(points, dtype=float)
        up = local[..., 2] if local.shape[-1] == 3 else np.zeros(local.shape[:-1])
        east, north = np.moveaxis(local[..., :2] @ self._rotation(), -1, 0)
        return np.stack(_topocentric(self).transform(east, north, up, direction="INVERSE"), axis=-1)

    def to_local(self, geodetic: ArrayLike) -> FloatArray:
        """Convert longitudes, latitudes [degree] and ellipsoidal heights [m] to local points (..., 3) [m].

        Parameters
        ----------
        geodetic : array (..., 2) or (..., 3)
            Longitude, latitude and optionally height. Without a height the point lies in the local plane ``z = 0``.

        Raises
        ------
        DataError
            pyproj is not installed, or a point lies over 100 km from the origin.
        """
        given = np.asarray(geodetic, dtype=float)
        longitude, latitude = given[..., 0], given[..., 1]
        if given.shape[-1] == 3:
            east, north, up = _topocentric(self).transform(longitude, latitude, given[..., 2])
        else:
            height = np.full(longitude.shape, self.height)
            # each step multiplies the error by 1 - cos(angle between the plumb lines): 1e-4 at 100 km, where the
            # first error is 785 m; four steps are more than enough
            for _ in range(4):
                east, north, up = _topocentric(self).transform(longitude, latitude, height)
                height = height - up
        distance = np.hypot(east, north)
        if not (distance <= MAX_DISTANCE).all():
            index = np.unravel_index(np.argmin(distance <= MAX_DISTANCE), distance.shape)
            raise DataError(
                f"longitude {longitude[index]}, latitude {latitude[index]} is more than {MAX_DISTANCE / 1e3:g} km from "
                f"the origin at {self.longitude}, {self.latitude}; expected degrees in this order, near the origin"
            )
        plane = np.stack([east, north], axis=-1) @ self._rotation().T
        return np.concatenate([plane, up[..., None]], axis=-1)

    def _rotation(self) -> FloatArray:
        """Rotation matrix; its rows are the local axes x and y in true east and north."""
        c, s = cos(radians(self.heading)), sin(radians(self.heading))
        return np.array([[c, -s], [s, c]])


def declared_frame(document: Mapping[str, Any]) -> tuple[str | None, Georeference | None]:
    """Read the coordinate system of a GeoJSON document, and its local frame.

    The member ``georeference`` tells both: the system is WGS 84. The old member ``crs`` tells only the first.

    Returns
    -------
    crs : str or None
        Coordinate system; None for local metres.
    frame : Georeference or None
        Local frame, if the document has one.

    Raises
    ------
    DataError
        A member is malformed.
    """
    if (place := document.get("georeference")) is not None:
        return WGS84, Georeference.from_dict(place)
    crs = document.get("crs")
    if crs is None:
        return None, None
    try:
        return str(crs["properties"]["name"]), None
    except (TypeError, KeyError):
        raise DataError("member crs has no name; expected the name of a coordinate system, or no crs") from None


def place_in_frame(points: FloatArray, crs: str | None, frame: Georeference | None) -> FloatArray:
    """Local points of points in a declared coordinate system.

    Parameters
    ----------
    points : array (..., 2)
        East and north, or longitude and latitude, in this order whatever the definition of the system says.
    crs : str or None
        Name, code or WKT of the coordinate system. None and engineering systems are local metres.
    frame : Georeference or None
        Local frame.

    Returns
    -------
    array (..., 2)
        [m]

    Raises
    ------
    DataError
        The system is not known, no frame is known, or pyproj is not installed.
    """
    if crs is None or LOCAL.match(crs):
        return points
    name = crs if len(crs) < 40 else crs.split('"')[1]
    if frame is None:
        raise DataError(
            f"is in {name} and no origin is known; write it in metres, or give the map an origin (erm export)"
        )
    pyproj = require_library("pyproj", "gis", name, "use local metres")
    try:
        transformer = pyproj.Transformer.from_crs(crs, WGS84, always_xy=True)
        longitude, latitude = transformer.transform(points[..., 0], points[..., 1])
    except pyproj.exceptions.ProjError as error:
        raise DataError(f"coordinate system {name} is not known ({error}); expected one such as EPSG:25832") from None
    return frame.to_local(np.stack([longitude, latitude], axis=-1))[..., :2]


def place_in_system(points: FloatArray, crs: str | None, frame: Georeference | None) -> FloatArray:
    """Points (..., 2) in a coordinate system of local points [m]; the inverse of `place_in_frame`.

    Raises
    ------
    DataError
        The system does not reach the place, or pyproj is not installed.
    """
    if crs is None or frame is None:
        return points
    pyproj = require_library("pyproj", "gis", crs, "use local metres")
    longitude, latitude, _ = np.moveaxis(frame.to_geodetic(points), -1, 0)
    transformer = pyproj.Transformer.from_crs(WGS84, crs, always_xy=True)
    placed = np.stack(transformer.transform(longitude, latitude), axis=-1)
    if not np.isfinite(placed).all():
        raise DataError(f"{crs} does not reach latitude {frame.latitude}, longitude {frame.longitude}; choose another")
    return placed


def known_system(name: str, *, metres: bool = False) -> str:
    """Code (``EPSG:25832``) of a coordinate system, or its WKT where it has none.

    Refuses one that is not known, or has no two axes on earth; with ``metres``, also degrees and feet.

    Raises
    ------
    OptionError
        See above.
    DataError
        pyproj is not installed.
    """
    pyproj = require_library("pyproj", "gis", name, "use local metres")
    try:
        system = pyproj.CRS.from_user_input(name)
    except pyproj.exceptions.ProjError:
        raise OptionError(f"coordinate system {name!r} is not known; expected one such as EPSG:25832") from None
    units = {axis.unit_name for axis in system.axis_info}
    if len(system.axis_info) != 2 or not (system.is_projected or system.is_geographic):
        raise OptionError(f"coordinate system {name} is no map of the earth; expected one such as EPSG:25832")
    if metres and units != {"metre"}:
        raise OptionError(f"coordinate system {name} is in {units.pop()}s; expected one in metres, such as EPSG:25832")
    return ":".join(system.to_authority() or ()) or system.to_wkt()


def remark_on_system(crs: str, frame: Georeference) -> str | None:
    """Say that an origin lies outside the area that a coordinate system is made for."""
    pyproj = require_library("pyproj", "gis", crs, "use local metres")
    area = pyproj.CRS.from_user_input(crs).area_of_use
    if area is None:
        return None
    width = (area.east - area.west) % 360 or 360.0
    inside = area.south <= frame.latitude <= area.north and (frame.longitude - area.west) % 360 <= width
    if inside:
        return None
    return (
        f"{crs} is made for longitudes {area.west:g} to {area.east:g} and latitudes {area.south:g} to {area.north:g}; "
        f"the origin is at longitude {frame.longitude:g}, latitude {frame.latitude:g}"
    )


def _topocentric(frame: Georeference) -> "Transformer":
    """Transformation from longitude, latitude, height to true east, north, up at the origin."""
    return topocentric(frame.latitude, frame.longitude, frame.height).transformer
