"""People who rest sit where seats are and stand where they may, never move, and are passed by all others."""

from functools import cache

import numpy as np
import pytest
import shapely

from simbev_ros.assets.regions.region_scene import Streetside
from simbev_ros.assets.regions.static_cache import load_streetside
from simbev_ros.assets.street.rest_kinds import RestKind, seats_among
from simbev_ros.config.load import load_scenario
from simbev_ros.config.scenario import MapScenes, Timing
from simbev_ros.config.traffic import Parked, Traffic
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Table
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.surface import strip_polygons
from simbev_ros.scene.blueprints import load_blueprints
from simbev_ros.scene.drawing.draw_scene import draw_scene, planned_scenes
from simbev_ros.scene.footprints import footprints
from simbev_ros.scene.reach import loaded_reach
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import Behavior
from simbev_ros.simulation.world.cast import first_prop_id
from simbev_ros.simulation.world.resting import resting_people
from simbev_ros.simulation.world.simulation import Simulation

FIRST_ID = 5000
SITS = np.array([blueprint.sits for blueprint in load_blueprints()])


@cache
def scene(share: float = 1.0) -> tuple[SceneSpec, RoadNetwork, Streetside]:
    """A dry scene by day with many pedestrians, its roads and what is beside them."""
    update = {
        "scenes": (MapScenes(map="Town02", train=1),),
        "traffic": Traffic(
            vehicles=20, pedestrians=200, spawn_radius_m=200.0, parked=Parked(density=0), resting_share=share
        ),
        "time": Timing(warm_up_s=2.0, duration_s=14.0),
    }
    scenario = load_scenario("paper").model_copy(update=update)
    [planned] = planned_scenes(scenario)
    network = load_network(planned.map)
    spec = draw_scene(scenario, planned, network)
    dry = spec.weather.model_copy(update={"precipitation": 0.0, "snow_cover": 0.0, "sun_altitude_deg": 40.0})
    spec = spec.model_copy(update={"weather": dry})
    return spec, network, load_streetside(spec.map, network, reach=loaded_reach(spec, network))


def resting(share: float = 1.0, **weather: float) -> Table:
    """People who rest in the scene in a weather."""
    spec, network, side = scene(share)
    spec = spec.model_copy(update={"weather": spec.weather.model_copy(update=weather)})
    return resting_people(spec, network, side.rests, {}, FIRST_ID)


def test_people_rest_in_proportion_to_the_share_and_nobody_without() -> None:
    assert len(resting(0.0)) == 0
    assert len(resting(1.0)) > 20
    assert 0.4 < len(resting(0.08)) / len(resting(0.16)) < 0.6


def test_the_paper_has_none() -> None:
    assert load_scenario("paper").traffic.resting_share == 0.0


def test_the_same_seed_has_the_same_people() -> None:
    np.testing.assert_array_equal(resting(), resting())


def test_people_sit_on_seats_with_their_backs_at_the_back_and_stand_elsewhere() -> None:
    rows, rests = resting(), scene()[2].rests
    sits = SITS[rows["blueprint"]]
    assert np.array_equal(sits, rows["behavior"] == Behavior.SITTING)
    assert 0.3 < sits.mean() < 0.9
    ahead_m = np.where(sits, rows["length"] / 2.0, 0.0)
    at_m = np.column_stack([rows["x"] - ahead_m * np.cos(rows["yaw"]), rows["y"] - ahead_m * np.sin(rows["yaw"])])
    gap_m = np.hypot(*(at_m[:, None] - np.column_stack([rests["x"], rests["y"]])).transpose(2, 0, 1))
    nearest = gap_m.argmin(axis=1)
    assert gap_m.min(axis=1).max() < 1e-3
    assert len(set(nearest.tolist())) == len(rows)
    assert np.array_equal(seats_among(rests[nearest]), sits)


@pytest.mark.parametrize("weather", [{"precipitation": 60.0}, {"snow_cover": 80.0}])
def test_nobody_sits_in_the_open_in_rain_or_snow(weather: dict[str, float]) -> None:
    rests = scene()[2].rests
    open_m = rests[np.isin(rests["kind"], [RestKind.BENCH, RestKind.CHAIR])]
    rows = resting(**weather)
    rows = rows[SITS[rows["blueprint"]]]
    gap_m = np.hypot(*(rows[axis][:, None] - open_m[axis] for axis in ("x", "y")))
    assert gap_m.min(initial=np.inf) > 0.6


def test_fewer_people_rest_by_night() -> None:
    assert len(resting(0.16, sun_altitude_deg=-20.0)) < 0.6 * len(resting(0.16))


def test_people_who_rest_never_move_and_nobody_walks_into_them() -> None:
    spec, network, side = scene()
    with Simulation(spec, network, *side[1:]) as simulation:
        states = [simulation.step() for _ in range(spec.warm_up_ticks + spec.ticks)]
    first = states[0].actors[states[0].actors["id"] >= first_prop_id(spec)]
    assert np.all(np.diff(states[-1].actors["id"].astype(np.int64)) > 0)
    seats = first[first["behavior"] == Behavior.SITTING]
    assert len(seats) > 10
    bodies = [footprint(first[first["behavior"] != Behavior.SITTING], 0.4), footprint(seats)]
    tree = shapely.STRtree(np.concatenate(bodies))
    for state in states:
        np.testing.assert_array_equal(state.actors[-len(first) :], first)
        others = state.actors[: -len(first)]
        trunk = shapely.points(others["x"], others["y"])
        walks = (others["tag"] == Tag.PEDESTRIAN) & (np.hypot(others["vx"], others["vy"]) < 2.3)
        assert not len(tree.query(trunk[walks], predicate="dwithin", distance=0.15)[0])
        assert not len(tree.query(trunk, predicate="dwithin", distance=0.03)[0])


def footprint(rows: Table, length_m: float | None = None) -> np.ndarray:
    """Footprints of rows, or of the trunks of people who stand."""
    size_m = np.column_stack([rows["length"] if length_m is None else np.full(len(rows), length_m), rows["width"]])
    return footprints(size_m, np.column_stack([rows["x"], rows["y"]]), rows["yaw"].astype(np.float64))


def test_nobody_who_rests_reaches_into_a_lane_of_traffic() -> None:
    _, network, _ = scene()
    lanes = strip_polygons(network.layout.strips_of(LaneKind.DRIVING, LaneKind.BICYCLE, LaneKind.PARKING, level=0))
    assert not len(shapely.STRtree(lanes).query(footprint(resting()), predicate="intersects")[0])


def test_nobody_at_a_table_touches_whoever_sits_opposite() -> None:
    rows = resting()
    seats = footprint(rows[rows["behavior"] == Behavior.SITTING])
    assert len(shapely.STRtree(seats).query(seats, predicate="intersects")[0]) == len(seats)
