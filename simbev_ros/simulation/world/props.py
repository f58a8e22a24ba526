"""Props of hazard areas: rows of the actors table that never change, and the obstacles they are for pedestrians."""

import numpy as np

from simbev_ros.assets.street.obstacles import OBSTACLE_DTYPE
from simbev_ros.foundation.types import Table
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.blueprints import blueprint_index, blueprint_named
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import ACTOR_DTYPE
from simbev_ros.simulation.world.kinematics.ground import GroundSurface


def prop_rows(spec: SceneSpec, first_id: int, ground: GroundSurface) -> Table:
    """(K,) ``ACTOR_DTYPE`` rows of the props, upright on the ground; ids ascend from ``first_id``."""
    props = [prop for hazard in spec.hazards for prop in hazard.props]
    blueprints = [blueprint_named(prop.blueprint) for prop in props]
    rows = np.zeros(len(props), ACTOR_DTYPE)
    position_m = np.array([(prop.x_m, prop.y_m, prop.z_m) for prop in props]).reshape(-1, 3)
    rows["x"], rows["y"] = position_m[:, :2].T
    rows["z"] = ground.heights_m(position_m) + ground.raised_m(position_m)
    rows["yaw"] = [prop.yaw_rad for prop in props]
    rows["length"], rows["width"], rows["height"] = np.array([each.size_m for each in blueprints]).reshape(-1, 3).T
    rows["id"] = first_id + np.arange(len(props))
    rows["color"] = [each.colors[number % len(each.colors)] for number, each in enumerate(blueprints)]  # alternately
    rows["blueprint"] = [blueprint_index()[each.name] for each in blueprints]
    rows["tag"] = [each.tag for each in blueprints]
    return rows


def prop_obstacles(rows: Table, network: RoadNetwork, ground: GroundSurface) -> Table:
    """(K,) ``OBSTACLE_DTYPE`` of the props on sidewalks; pedestrians pass them on the side away from the road."""
    position_m = np.column_stack([rows["x"], rows["y"], rows["z"]]).astype(np.float64)
    on_sidewalk = ground.raised_m(position_m) > 0.0
    rows, position_m = rows[on_sidewalk], position_m[on_sidewalk]
    obstacles = np.zeros(len(rows), OBSTACLE_DTYPE)
    obstacles["x"], obstacles["y"], obstacles["z"] = position_m.T
    obstacles["radius"] = np.maximum(rows["length"], rows["width"]) / 2.0
    if len(rows):
        outward_m = (position_m - network.nearest_lane(position_m).position_m)[:, :2]
        obstacles["away_x"], obstacles["away_y"] = (outward_m / np.linalg.norm(outward_m, axis=1)[:, None]).T
    return obstacles
