"""Hazard areas as labelled ground, so that they count like the roads that they lie on."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely

from simbev_ros.annotation.bev.footprint import Footprint
from simbev_ros.assets.mesh.primitives import triangulate
from simbev_ros.maps.roads.layout import Layout
from simbev_ros.scene.hazards.hazard import HazardSpec
from simbev_ros.semantics import BEV_CLASSES
from simbev_ros.world.kinematics.ground import Ground


class LabelledArea(NamedTuple):
    """Ground on roads of a level, besides that of the map."""

    ground: Footprint
    level: int


def hazard_areas(hazards: Sequence[HazardSpec], layout: Layout) -> tuple[LabelledArea, ...]:
    """The areas of hazards, on the levels of the roads below them."""
    footprints = [_footprint(hazard) for hazard in hazards]
    middle_m = [(*each.points_m.mean(axis=0), hazard.z_m) for each, hazard in zip(footprints, hazards, strict=True)]
    levels = Ground(layout).levels(np.array(middle_m).reshape(-1, 3)).tolist()
    return tuple(map(LabelledArea, footprints, levels))


def _footprint(hazard: HazardSpec) -> Footprint:
    points_m, triangles = triangulate(shapely.Polygon(hazard.outline_m))
    return Footprint(points_m, triangles, np.full(len(triangles), BEV_CLASSES.index("hazard"), np.uint8))
