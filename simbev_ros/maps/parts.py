"""The parts of a map: the common result of all importers (recipe, OpenDRIVE, OpenStreetMap, Lanelet2, SUMO net)."""

from dataclasses import dataclass
from pathlib import Path

from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.maps.findings import Finding
from simbev_ros.maps.land_features import MapFeatures
from simbev_ros.maps.roads.layout import Layout


@dataclass(frozen=True, slots=True)
class MapParts:
    """The parts of a map, as an importer returns them.

    Attributes:
        net: SUMO net file, its coordinates in the map frame.
        opendrive: OpenDRIVE file of the same roads.
        datum: Position of the map frame's origin on Earth.
        features: The land around the roads.
        layout: Ground geometry of the lanes; None: follow SUMO's lanes and paint by rule.
        opendrive_of_net: netconvert made the OpenDRIVE file from the net, and named the traffic lights in it.
        findings: What was left out, repaired or assumed.
        extract: OpenStreetMap file with the part of the map's file that was read; None: all of it was.
        origin_m: Coordinates of the map frame's origin in the map's file.
    """

    net: Path
    opendrive: Path
    datum: MapDatum
    features: MapFeatures
    layout: Layout | None = None
    opendrive_of_net: bool = True
    findings: tuple[Finding, ...] = ()
    extract: Path | None = None
    origin_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
