"""East, north, up at a place on earth."""

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from erm.common.errors import DataError
from erm.common.optional import require_library

if TYPE_CHECKING:
    from pyproj import Transformer

MAX_DISTANCE = 100e3
"""A point farther than this from the origin is an error [m]; chosen."""


@dataclass(frozen=True)
class Topocentric:
    """Tangent plane of WGS 84 at an origin.

    Attributes
    ----------
    latitude, longitude : float
        Of the origin [degree].
    height : float
        Above the ellipsoid [m].
    transformer : pyproj.Transformer
        From longitude, latitude [degree] and height to east, north, up [m].
    """

    latitude: float
    longitude: float
    height: float
    transformer: "Transformer"

    def place(self, latitude: float, longitude: float, height: float, *, who: str) -> NDArray[np.float64]:
        """East, north, up (3,) [m] of a point near the origin; ``who`` is named in errors.

        Raises
        ------
        DataError
            It is more than 100 km away.
        """
        point = np.array(self.transformer.transform(longitude, latitude, height))
        if not np.hypot(*point[:2]) <= MAX_DISTANCE:
            raise DataError(
                f"{who} is at latitude {latitude}, longitude {longitude}, more than {MAX_DISTANCE / 1e3:g} km from the "
                f"origin at {self.latitude}, {self.longitude}; expected degrees in this order, near the origin"
            )
        return point


@lru_cache(maxsize=16)
def topocentric(latitude: float, longitude: float, height: float) -> Topocentric:
    """Tangent plane at a place; EPSG Guidance Note 7-2, geocentric/topocentric conversions.

    Raises
    ------
    DataError
        pyproj is not installed.
    """
    pyproj = require_library("pyproj", "gis", "WGS 84", "use local metres")
    transformer = pyproj.Transformer.from_pipeline(
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step +proj=cart +ellps=WGS84 "
        f"+step +proj=topocentric +ellps=WGS84 +lat_0={latitude!r} +lon_0={longitude!r} +h_0={height!r}"
    )
    return Topocentric(latitude, longitude, height, transformer)
