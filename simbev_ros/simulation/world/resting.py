"""People who rest: rows of the actors table that sit or stand at the same spot for the whole scene, and never move.

They have no part in SUMO's traffic. Pedestrians on the sidewalk walk around them.
"""

from collections.abc import Mapping

import numpy as np
import shapely

from simbev_ros.assets.street.obstacles import OBSTACLE_DTYPE
from simbev_ros.assets.street.rest_kinds import RestKind, seats_among
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import Table
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.blueprints import Blueprint, blueprint_index, blueprint_named
from simbev_ros.scene.drawing.scene_drawer import dressed_for
from simbev_ros.scene.footprints import footprints
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import ACTOR_DTYPE, Behavior
from simbev_ros.simulation.world.kinematics.ground import GroundSurface
from simbev_ros.simulation.world.parked import agent_routes, is_clear
from simbev_ros.simulation.world.pedestrians.itineraries import Leg

_REACH_M, _BY_NIGHT = 80.0, 0.5  # from the agents' routes; factor of the share
_RAIN, _SNOW = 10.0, 20.0  # percent, from which nobody sits in the open
_SEAT_WEIGHT, _LOOK_SD_RAD = 3.0, 0.25  # there are fewer seats than windows
_MAX_STANDING_M = 1.3  # length of the box: nobody stands with a dog, a pram or a suitcase
_MAX_AT_TABLE_M = 0.85  # likewise: nobody stretches the legs below a table
_STRETCH_M, _SWING_M = (-1.2, 0.0, 1.2), 0.35  # along the sidewalk; the corner that runners cut


def resting_people(
    spec: SceneSpec, network: RoadNetwork, rests: Table, excursions: Mapping[int, tuple[Leg, ...]], first_id: int
) -> Table:
    """Draw the people who rest: as many as ``spec.resting_share`` of those who walk near the agents' routes.

    They take some of the (N,) ``REST_DTYPE`` spots ``rests``, off the paths of ``excursions``. The (K,) ``ACTOR_DTYPE``
    rows have ids from ``first_id`` on.
    """
    if spec.resting_share == 0.0 or not len(rests) or not spec.pedestrians:
        return np.zeros(0, ACTOR_DTYPE)
    routes = shapely.GeometryCollection(list(agent_routes(spec, network)))
    starts_m = [network.pose_on_lane(each.start.lane, each.start.s_m)[0] for each in spec.pedestrians]
    walkers = np.count_nonzero(shapely.dwithin(routes, shapely.points(np.array(starts_m)[:, :2]), _REACH_M))
    near = shapely.dwithin(routes, shapely.points(rests["x"], rests["y"]), _REACH_M)
    is_wet = spec.weather.precipitation > _RAIN or spec.weather.snow_cover > _SNOW
    rests = rests[near & ~(is_wet & np.isin(rests["kind"], [RestKind.BENCH, RestKind.CHAIR]))]
    rng = stream(spec.seed, "resting")
    share = spec.resting_share * (_BY_NIGHT if spec.weather.sun_altitude_deg < 0.0 else 1.0)
    order = np.argsort(rng.exponential(size=len(rests)) / np.where(seats_among(rests), _SEAT_WEIGHT, 1.0))
    taken = np.sort(order[: round(share * walkers)])
    dressed = [blueprint_named(name) for name in dressed_for(spec.weather, spec.seed)]
    sitting = [each for each in dressed if each.sits]
    standing = [each for each in dressed if each.frequency and each.on_foot and each.size_m[0] < _MAX_STANDING_M]
    at_table = [each for each in sitting if each.size_m[0] < _MAX_AT_TABLE_M]
    people = {RestKind.CHAIR: at_table, RestKind.SHELTER: standing, RestKind.WINDOW: standing}
    rows = np.array([_row(rest, people.get(rest["kind"], sitting), rng) for rest in rests[taken]], ACTOR_DTYPE)
    center_m, size_m = (np.column_stack([rows[name] for name in names]) for names in (("x", "y"), ("length", "width")))
    rows = rows[is_clear(spec, footprints(size_m, center_m, rows["yaw"].astype(np.float64)), excursions)]
    rows["id"] = first_id + np.arange(len(rows))
    return rows


def resting_obstacles(rows: Table, ground: GroundSurface) -> Table:
    """(3 * K,) ``OBSTACLE_DTYPE`` of the K people on sidewalks, whom others pass in front: long enough for runners."""
    rows = rows[ground.raised_m(np.column_stack([rows["x"], rows["y"], rows["z"]]).astype(np.float64)) > 0.0]
    obstacles = np.zeros((len(_STRETCH_M), len(rows)), OBSTACLE_DTYPE)
    along_m = np.array(_STRETCH_M)[:, None]
    obstacles["away_x"], obstacles["away_y"] = np.cos(rows["yaw"]), np.sin(rows["yaw"])
    obstacles["x"] = rows["x"] - along_m * obstacles["away_y"]
    obstacles["y"] = rows["y"] + along_m * obstacles["away_x"]
    obstacles["z"], obstacles["radius"] = rows["z"], rows["length"] / 2.0 + _SWING_M
    return obstacles.ravel()


def _row(rest: Table, kinds: list[Blueprint], rng: np.random.Generator) -> Table:
    """Row of the person on one spot, of one of these kinds, shape (); the id is missing."""
    blueprint = kinds[int(rng.integers(len(kinds)))]
    length_m, width_m, height_m = blueprint.size_m
    ahead_m, look_rad = (length_m / 2.0, 0.0) if blueprint.sits else (0.0, rng.normal(0.0, _LOOK_SD_RAD))
    row = np.zeros((), ACTOR_DTYPE)
    row["x"] = rest["x"] + ahead_m * np.cos(rest["yaw"])
    row["y"] = rest["y"] + ahead_m * np.sin(rest["yaw"])
    row["z"], row["yaw"] = rest["z"], np.angle(np.exp(1j * (rest["yaw"] + look_rad)))
    row["length"], row["width"], row["height"] = length_m, width_m, height_m
    row["color"] = blueprint.colors[int(rng.integers(len(blueprint.colors)))]
    row["blueprint"], row["tag"] = blueprint_index()[blueprint.name], blueprint.tag
    row["behavior"] = Behavior.SITTING * blueprint.sits
    return row
