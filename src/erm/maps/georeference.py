"""Where on earth the local metres lie: a tangent plane on WGS 84, turned by a heading."""

import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import lru_cache
from math import cos, isfinite, radians, sin
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from erm.common.errors import DataError
from erm.common.optional import require_library
from erm.geometry.vertical import FloatArray

if TYPE_CHECKING:
    from pyproj import Transformer

FARTHEST = 100e3
"""Distance from the origin beyond which a place is taken for a mistake [m]."""
GEODETIC = re.compile(r"CRS:?84$|EPSG:.*:(4326|4979)$|EPSG:(4326|4979)$")
"""Names of WGS 84 in the ``crs`` of GeoJSON older than RFC 7946, which some programs still write."""


@dataclass(frozen=True)
class Georeference:
    """Place and heading of a local frame.

    With ``h`` the heading, a local point ``(x, y, z)`` lies in the topocentric frame of the origin at::

        east  =  x cos h + y sin h
        north = -x sin h + y cos h
        up    =  z

    and from there by way of geocentric coordinates at its latitude, longitude and ellipsoidal height (EPSG
    Guidance Note 7-2, geocentric/topocentric conversions). The local frame is a plane, not a map projection:
    its distances are true everywhere and its vertical is that of the origin. At 1 km from there, the plane has
    risen 0.08 m over the ellipsoid and the plumb line leans by 0.009 degree.

    Parameters
    ----------
    latitude, longitude : float
        Of the local (0, 0, 0), WGS 84 [degree].
    height : float
        Of the local (0, 0, 0) above the ellipsoid [m], which is not that above the sea. 100 m of it change
        positions at 1 km by 16 mm.
    heading : float
        Bearing of the local y axis, degrees clockwise from true north.
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
        """Undo ``dataclasses.asdict``; height and heading may be absent."""
        try:
            return cls(**{name: float(value) for name, value in values.items()})
        except DataError:
            raise
        except (TypeError, ValueError, AttributeError) as error:
            raise DataError(
                f"georeference is malformed ({error}); expected latitude, longitude, height and heading"
            ) from error

    def to_geodetic(self, points: ArrayLike) -> FloatArray:
        """Longitude, latitude [degree] and ellipsoidal height [m] (..., 3) of local points.

        Parameters
        ----------
        points : array (..., 2) or (..., 3)
            East, north and possibly up, local [m]; up is 0 where it is not given.

        Raises
        ------
        DataError
            pyproj is not installed.
        """
        local = np.asarray(points, dtype=float)
        up = local[..., 2] if local.shape[-1] == 3 else np.zeros(local.shape[:-1])
        east, north = np.moveaxis(local[..., :2] @ self._turn(), -1, 0)
        return np.stack(_topocentric(self).transform(east, north, up, direction="INVERSE"), axis=-1)

    def to_local(self, geodetic: ArrayLike) -> FloatArray:
        """Local points (..., 3) [m] of longitudes, latitudes [degree] and ellipsoidal heights [m].

        Parameters
        ----------
        geodetic : array (..., 2) or (..., 3)
            Without a height, the point of the local plane ``z = 0`` at that longitude and latitude.

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
            # A step leaves 1 - cos of the angle between the plumb lines, 1e-4 at 100 km where 785 m are to go:
            # four are more than enough.
            for _ in range(4):
                east, north, up = _topocentric(self).transform(longitude, latitude, height)
                height = height - up
        distance = np.hypot(east, north)
        if not (distance <= FARTHEST).all():
            index = np.unravel_index(np.argmin(distance <= FARTHEST), distance.shape)
            raise DataError(
                f"longitude {longitude[index]}, latitude {latitude[index]} is more than {FARTHEST / 1e3:g} km from the "
                f"origin at {self.longitude}, {self.latitude}; expected degrees in this order, near the origin"
            )
        plane = np.stack([east, north], axis=-1) @ self._turn().T
        return np.concatenate([plane, up[..., None]], axis=-1)

    def _turn(self) -> FloatArray:
        """Rows: the local axes x and y in true east and north."""
        c, s = cos(radians(self.heading)), sin(radians(self.heading))
        return np.array([[c, -s], [s, c]])


def declared(document: Mapping[str, Any]) -> tuple[bool, Georeference | None]:
    """Whether a GeoJSON document says that it holds longitudes and latitudes, and in which local frame to read them.

    The member ``georeference`` says both, an old ``crs`` that names WGS 84 only the first.
    """
    if (place := document.get("georeference")) is not None:
        return True, Georeference.from_dict(place)
    crs = document.get("crs")
    properties = crs.get("properties") if isinstance(crs, dict) else None
    name = properties.get("name") if isinstance(properties, dict) else None
    return isinstance(name, str) and GEODETIC.search(name) is not None, None


@lru_cache(maxsize=16)
def _topocentric(frame: Georeference) -> "Transformer":
    """From longitude, latitude, height to true east, north, up at the origin."""
    pyproj = require_library("pyproj", "gis", "WGS 84", "stay in local metres")
    return pyproj.Transformer.from_pipeline(
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step +proj=cart +ellps=WGS84 "
        f"+step +proj=topocentric +ellps=WGS84 +lat_0={frame.latitude!r} +lon_0={frame.longitude!r} "
        f"+h_0={frame.height!r}"
    )
