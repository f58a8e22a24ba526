"""Conversion between the map frame and WGS84 coordinates, through pyproj.

The map frame is a transverse Mercator plane of scale 1 that touches the ellipsoid at the map's origin, unless the map
defines its own projection.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import atan2, cos, pi, radians, remainder, sin

import numpy as np
from pyproj import Transformer

from simbev_ros.foundation.types import Float64Array

_SHORT_DEG = 1e-3
_ALIGNED_RAD = 1e-6


@dataclass(frozen=True)
class MapDatum:
    """Position and orientation of the map frame on Earth.

    Attributes:
        latitude_deg: Latitude of the map's origin.
        longitude_deg: Longitude of the map's origin.
        altitude_m: Altitude of the map's origin.
        projection: Projection of the plane that the map lies in, in any form that PROJ reads. If empty, map x points
            east and y north in the transverse Mercator plane that touches the ellipsoid at the origin.
        false_easting_m: x of the map's origin in that projection.
        false_northing_m: y of the map's origin in that projection.
        heading_rad: Direction of map x in that projection.
    """

    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    projection: str = ""
    false_easting_m: float = 0.0
    false_northing_m: float = 0.0
    heading_rad: float = 0.0

    @property
    def proj_string(self) -> str:
        """Projection as a PROJ string, as written into an OpenDRIVE geoReference."""
        return self.projection or (
            f"+proj=tmerc +lat_0={self.latitude_deg!r} +lon_0={self.longitude_deg!r} +k=1 "
            "+x_0=0 +y_0=0 +datum=WGS84 +units=m +no_defs"
        )

    @cached_property
    def _transformer(self) -> Transformer:
        return Transformer.from_crs(self.proj_string, "EPSG:4326", always_xy=True)

    def geodetic_from_map(self, xyz_map: Float64Array | Sequence[float]) -> tuple[float, float, float]:
        """Latitude in °, longitude in ° and altitude in m of one (3,) point in meters, map frame."""
        x, y = float(xyz_map[0]), float(xyz_map[1])
        cosine, sine = cos(self.heading_rad), sin(self.heading_rad)
        longitude, latitude = self._transformer.transform(
            self.false_easting_m + cosine * x - sine * y, self.false_northing_m + sine * x + cosine * y
        )
        return latitude, longitude, self.altitude_m + float(xyz_map[2])

    def map_from_geodetic(
        self, latitude_deg: float, longitude_deg: float, altitude_m: float
    ) -> tuple[float, float, float]:
        """x, y, z in meters, map frame, of a WGS84 position."""
        east, north = self._transformer.transform(longitude_deg, latitude_deg, direction="INVERSE")
        east, north = east - self.false_easting_m, north - self.false_northing_m
        cosine, sine = cos(self.heading_rad), sin(self.heading_rad)
        return cosine * east + sine * north, cosine * north - sine * east, altitude_m - self.altitude_m

    @cached_property
    def north_rad(self) -> float:
        """Direction of north at the map's origin, counterclockwise from map x; π/2 if map x points east."""
        north_m = self.map_from_geodetic(self.latitude_deg + _SHORT_DEG, self.longitude_deg, self.altitude_m)
        here_m = self.map_from_geodetic(self.latitude_deg, self.longitude_deg, self.altitude_m)
        return atan2(north_m[1] - here_m[1], north_m[0] - here_m[0])

    @property
    def map_from_east_rad(self) -> float:
        """Direction of map x at the map's origin, counterclockwise from east; exactly 0 if it points east."""
        turned_rad = remainder(pi / 2.0 - self.north_rad, 2.0 * pi)
        return 0.0 if abs(turned_rad) < _ALIGNED_RAD else turned_rad


def earth_from_map(
    latitude_deg: float, longitude_deg: float, altitude_m: float, map_from_east_rad: float
) -> Float64Array:
    """(4, 4) pose in the earth-centered, earth-fixed frame of WGS 84 of a map with its origin at a place.

    Args:
        latitude_deg: Latitude of the origin.
        longitude_deg: Longitude of the origin.
        altitude_m: Altitude of the origin.
        map_from_east_rad: Direction of map x, counterclockwise from east.
    """
    latitude_rad, longitude_rad = radians(latitude_deg), radians(longitude_deg)
    (sp, cp), (sl, cl) = ((sin(each), cos(each)) for each in (latitude_rad, longitude_rad))
    st, ct = sin(map_from_east_rad), cos(map_from_east_rad)
    east, north, up = np.array([-sl, cl, 0.0]), np.array([-sp * cl, -sp * sl, cp]), np.array([cp * cl, cp * sl, sp])
    pose = np.eye(4)
    pose[:3, :3] = np.stack([ct * east + st * north, ct * north - st * east, up], axis=1)
    earth_from_geodetic = Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)
    pose[:3, 3] = earth_from_geodetic.transform(longitude_deg, latitude_deg, altitude_m)
    return pose
