"""OpenStreetMap importer: roads are built by netconvert; buildings, water and land use are read by the package
itself."""

from simbev_ros.maps.osm.importer import import_osm

__all__ = ["import_osm"]
