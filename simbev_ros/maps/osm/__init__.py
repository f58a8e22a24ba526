"""OpenStreetMap: roads through netconvert, buildings, water and land use by a reader of our own."""

from simbev_ros.maps.osm.importer import import_osm

__all__ = ["import_osm"]
