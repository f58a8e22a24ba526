"""What every kind of map (town recipe, OpenDRIVE, OpenStreetMap, SUMO net) is turned into, before the RoadNetwork."""

from dataclasses import dataclass
from pathlib import Path

from simbev_ros.geometry.geodesy import MapDatum
from simbev_ros.maps.land_features import MapFeatures
from simbev_ros.maps.roads.layout import Layout


@dataclass(frozen=True, slots=True)
class MapParts:
    """The parts of a map.

    Attributes:
        net: SUMO net file, its coordinates in the map frame.
        opendrive: OpenDRIVE file of the same roads.
        datum: Where the map frame's origin lies on Earth.
        features: What the map says about the land beside the roads.
        layout: Where lanes lie on the ground; None: follow SUMO's lanes and paint by rule.
        notes: What had to be repaired or left out, one sentence each, for the user.
    """

    net: Path
    opendrive: Path
    datum: MapDatum
    features: MapFeatures
    layout: Layout | None = None
    notes: tuple[str, ...] = ()
