"""OpenStreetMap importer: netconvert builds the roads; buildings, water and land use are read here."""

from simbev_ros.maps.osm.importer import import_osm

__all__ = ["import_osm"]
