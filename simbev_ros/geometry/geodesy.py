"""Map frame ↔ WGS84, through pyproj.

The map frame is a transverse Mercator plane of scale 1 that touches the ellipsoid at the map's origin.
"""

from dataclasses import dataclass
from functools import cached_property

from pyproj import Transformer

from simbev_ros.types import Float64Array


@dataclass(frozen=True)
class MapDatum:
    """Where the map frame's origin lies on Earth; map x points east, y north."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float

    @property
    def proj_string(self) -> str:
        """The projection as a PROJ string, as written into an OpenDRIVE geoReference."""
        return (
            f"+proj=tmerc +lat_0={self.latitude_deg!r} +lon_0={self.longitude_deg!r} +k=1 "
            "+x_0=0 +y_0=0 +datum=WGS84 +units=m +no_defs"
        )

    @cached_property
    def _transformer(self) -> Transformer:
        return Transformer.from_crs(self.proj_string, "EPSG:4326", always_xy=True)

    def geodetic_from_map(self, xyz_map: Float64Array) -> tuple[float, float, float]:
        """Latitude °, longitude °, altitude m of one (3,) point in metres, map frame."""
        longitude, latitude = self._transformer.transform(float(xyz_map[0]), float(xyz_map[1]))
        return latitude, longitude, self.altitude_m + float(xyz_map[2])

    def map_from_geodetic(
        self, latitude_deg: float, longitude_deg: float, altitude_m: float
    ) -> tuple[float, float, float]:
        """x, y, z in metres, map frame."""
        x, y = self._transformer.transform(longitude_deg, latitude_deg, direction="INVERSE")
        return x, y, altitude_m - self.altitude_m
