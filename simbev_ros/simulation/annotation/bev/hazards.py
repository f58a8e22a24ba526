"""Hazard areas as labeled footprints, so that the BEV grid treats them like the roads that they lie on."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely

from simbev_ros.assets.mesh.primitives import triangulate
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.maps.roads.layout import Layout
from simbev_ros.schema.scene.hazard import HazardSpec
from simbev_ros.simulation.annotation.bev.footprint import Footprint
from simbev_ros.simulation.world.kinematics.ground import GroundSurface


class LabeledArea(NamedTuple):
    """A labeled footprint on the roads of one level, in addition to the map's own surfaces."""

    ground: Footprint
    level: int


def hazard_areas(hazards: Sequence[HazardSpec], layout: Layout) -> tuple[LabeledArea, ...]:
    """Footprints of hazards, each with the level of the road below it."""
    footprints = [_footprint(hazard) for hazard in hazards]
    center_m = [(*each.points_m.mean(axis=0), hazard.z_m) for each, hazard in zip(footprints, hazards, strict=True)]
    levels = GroundSurface(layout).levels(np.array(center_m).reshape(-1, 3)).tolist()
    return tuple(map(LabeledArea, footprints, levels))


def _footprint(hazard: HazardSpec) -> Footprint:
    points_m, triangles = triangulate(shapely.Polygon(hazard.outline_m))
    return Footprint(points_m, triangles, np.full(len(triangles), BEV_CLASSES.index("hazard"), np.uint8))
