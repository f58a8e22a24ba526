"""The things around hazard areas, which never move, as rows of the actors table."""

import numpy as np

from simbev_ros.scene.blueprints import blueprint_index
from simbev_ros.scene.spec import SceneSpec
from simbev_ros.scene.state import ACTOR_DTYPE
from simbev_ros.types import Table
from simbev_ros.world.cast import blueprint_of
from simbev_ros.world.ground import Ground


def prop_rows(spec: SceneSpec, first_id: int, ground: Ground) -> Table:
    """(K,) ``ACTOR_DTYPE``, upright on the ground; ids ascend from ``first_id``."""
    props = [prop for hazard in spec.hazards for prop in hazard.props]
    blueprints = [blueprint_of(prop.blueprint) for prop in props]
    rows = np.zeros(len(props), ACTOR_DTYPE)
    place_m = np.array([(prop.x_m, prop.y_m, prop.z_m) for prop in props]).reshape(-1, 3)
    rows["x"], rows["y"] = place_m[:, :2].T
    rows["z"] = ground.heights_m(place_m) + ground.raised_m(place_m)
    rows["yaw"] = [prop.yaw_rad for prop in props]
    rows["length"], rows["width"], rows["height"] = np.array([each.size_m for each in blueprints]).reshape(-1, 3).T
    rows["id"] = first_id + np.arange(len(props))
    rows["color"] = [each.colors[number % len(each.colors)] for number, each in enumerate(blueprints)]  # alternately
    rows["blueprint"] = [blueprint_index()[each.name] for each in blueprints]
    rows["tag"] = [each.tag for each in blueprints]
    return rows
