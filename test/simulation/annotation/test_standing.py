import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from synthetic_world import EGO_ID, actor, box_model, world

from simbev_ros.assets.placement.static_scene import Tile
from simbev_ros.assets.regions.build import build_region
from simbev_ros.foundation.geometry.transforms import rotations_from_rpy
from simbev_ros.foundation.semantics import BOX_CLASSES, SIGN_TYPES, Tag
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.build import load_network
from simbev_ros.maps.land.terrain import Terrain
from simbev_ros.maps.network import RoadNetwork, Signal
from simbev_ros.maps.region import REGION_M, Region
from simbev_ros.maps.roads.layout import Sign, SignKind
from simbev_ros.maps.source import map_spec
from simbev_ros.scene.blueprints import blueprint_index
from simbev_ros.schema.boxes import LIGHT_IDS, NO_BLUEPRINT, SIGN_IDS
from simbev_ros.schema.scene.state import SIGNAL_DTYPE, SignalState, WorldState
from simbev_ros.simulation.annotation.boxes.boxes import boxes_around_ego
from simbev_ros.simulation.annotation.boxes.standing import find_static_objects

CENTIMETER = 0.01
DECIMETER = 0.1
CARLA = Path(__file__).parents[4] / "shared" / "maps" / "carla" / "Town01.xodr"
TOWNS = [
    pytest.param("Town03", Region(-1, -1), marks=pytest.mark.slow),
    ("Town04", Region(-2, -2)),
    pytest.param("Town10HD", Region(-1, -1), marks=pytest.mark.slow),
    pytest.param(
        str(CARLA),
        Region(0, -1),
        marks=[pytest.mark.slow, pytest.mark.skipif(not CARLA.exists(), reason="no CARLA maps")],
    ),
]
CAR = box_model(Tag.CAR, (4.0, 2.0, 1.5))
SEDAN = blueprint_index()["vehicle.sedan"]
AT_M = (100.0, 50.0, 2.0)


def vertices_of(tiles: Sequence[Tile], tag: Tag) -> Float64Array:
    """(V, 3) all vertices of a tag in tiles, map frame."""
    return np.concatenate([tile.mesh.vertices[tile.mesh.tag == tag] + tile.origin_m for tile in tiles])


@pytest.mark.parametrize(("town", "region"), TOWNS)
def test_boxes_enclose_all_lights_and_signs_tightly(town: str, region: Region) -> None:
    network = load_network(map_spec(town))
    standing = find_static_objects(network)
    tiles = build_region(network, region, Terrain(network)).tiles
    in_region = (np.floor(standing.foot_m[:, :2] / REGION_M) == region).all(axis=1)
    for tag in Tag.TRAFFIC_LIGHT, Tag.TRAFFIC_SIGN:
        vertices_m = vertices_of(tiles, tag)
        enclosed = np.zeros(len(vertices_m), bool)
        table = standing.boxes[in_region & (standing.boxes["tag"] == tag)]
        assert len(table)
        for box in table:
            local_m = vertices_m - [box["x"], box["y"], box["z"]]
            local_m = local_m @ rotations_from_rpy(np.array([box["roll"], box["pitch"], box["yaw"]]))
            half_m = np.array([box["length"], box["width"], box["height"]]) / 2.0
            inside = (np.abs(local_m) <= half_m + CENTIMETER).all(axis=1)
            near = (np.abs(local_m) <= half_m + DECIMETER).all(axis=1)
            assert np.array_equal(inside, near), "nothing sticks out of a box"
            enclosed |= inside
            np.testing.assert_allclose(local_m[inside].min(axis=0), -half_m, atol=CENTIMETER)
            np.testing.assert_allclose(local_m[inside].max(axis=0), half_m, atol=CENTIMETER)
        assert enclosed.all() or tag == Tag.TRAFFIC_SIGN, "only plates and boards that no map has are without a box"


@lru_cache(maxsize=1)
def network_with_row() -> RoadNetwork:
    """A town whose only lights and signs stand in a row to the north and face east."""
    network = load_network(map_spec("Blocks"))
    x, y, z = AT_M
    signals = tuple(
        Signal(np.array([x, y + 5.0 * k, z + 4.0]), 0.0, np.array([x - 1.0, y + 5.0 * k, z]), "programme", k, "lane")
        for k in range(3)
    )
    signs = tuple(
        Sign(kind, np.array([x, y + 20.0 + 4.0 * k, z]), 0.0, (), 30 / 3.6 if kind is SignKind.SPEED_LIMIT else 0.0)
        for k, kind in enumerate(SignKind)
    )
    return replace(network, signals=signals, layout=replace(network.layout, signs=signs))


def state_with(*states: SignalState) -> WorldState:
    """World with the ego at the row's southern end, heading north, and another car beside it."""
    x, y, z = AT_M
    ego = actor(CAR, SEDAN, id=EGO_ID, x=x, y=y, z=z, yaw=math.pi / 2)
    signals = np.zeros(len(states), SIGNAL_DTYPE)
    signals["id"], signals["state"] = 1 + np.arange(len(states)), states
    return replace(world(ego, actor(CAR, SEDAN, id=900, x=x + 5.0, y=y, z=z)), signals=signals)


def test_lights_and_signs_follow_the_actors_with_their_own_columns() -> None:
    state = state_with(SignalState.RED, SignalState.OFF, SignalState.GREEN)
    found = boxes_around_ego(state, 50.0, static_objects=find_static_objects(network_with_row()))
    lights, signs = LIGHT_IDS + 1 + np.arange(3), SIGN_IDS + 1 + np.arange(3)
    assert found["id"].tolist() == [900, *lights, *signs]
    static_objects = found[1:]
    assert [BOX_CLASSES[index] for index in static_objects["class"]] == ["traffic_light"] * 3 + ["traffic_sign"] * 3
    assert static_objects["tag"].tolist() == [Tag.TRAFFIC_LIGHT] * 3 + [Tag.TRAFFIC_SIGN] * 3
    assert static_objects["state"].tolist() == [SignalState.RED, SignalState.OFF, SignalState.GREEN, 0, 0, 0]
    assert [SIGN_TYPES[index] for index in static_objects["sign"]] == ["", "", "", *SignKind]
    assert static_objects["limit"] == pytest.approx([0.0, 0.0, 0.0, 0.0, 0.0, 30 / 3.6])
    assert (static_objects["blueprint"] == NO_BLUEPRINT).all()
    assert static_objects["on_ego_level"].all()
    assert np.isnan(static_objects["visibility"]).all()
    assert (static_objects["lidar_points"] == -1).all()
    for name in ("vx", "wz", "ax", "parent", "lights", "doors", "behavior", "valid", "roll", "pitch", "yaw"):
        assert not static_objects[name].any()


def test_distance_and_angle_of_static_objects_are_measured_as_for_actors() -> None:
    found = boxes_around_ego(
        state_with(*[SignalState.RED] * 3), 50.0, static_objects=find_static_objects(network_with_row())
    )
    light = found[found["id"] == LIGHT_IDS + 3][0]
    forward_m, left_m, up_m = light["y"] - AT_M[1], AT_M[0] - light["x"], light["z"] - AT_M[2] - 0.75
    assert forward_m == pytest.approx(10.0)
    assert light["distance"] == pytest.approx(np.linalg.norm([forward_m, left_m, up_m]))
    assert light["angle"] == pytest.approx(math.atan2(left_m, forward_m), abs=1e-6)


def test_only_objects_within_the_radius_have_boxes() -> None:
    static_objects = find_static_objects(network_with_row())
    found = boxes_around_ego(state_with(*[SignalState.RED] * 3), 10.5, static_objects=static_objects)
    assert found["id"].tolist() == [900, LIGHT_IDS + 1, LIGHT_IDS + 2]
    assert boxes_around_ego(state_with(), 3.0, static_objects=static_objects).shape == (0,)


def test_a_map_without_lights_and_signs_adds_no_boxes() -> None:
    empty = replace(network_with_row(), signals=(), layout=replace(network_with_row().layout, signs=()))
    assert boxes_around_ego(state_with(), 50.0, static_objects=find_static_objects(empty))["id"].tolist() == [900]


def test_hazard_warning_signs_have_their_type() -> None:
    rows = [
        actor(box_model(Tag.TRAFFIC_SIGN, (0.8, 0.8, 1.6)), blueprint_index()[f"prop.sign_{name}"], id=20 + k, x=5.0)
        for k, name in enumerate(("works", "accident"))
    ]
    found = boxes_around_ego(world(actor(CAR, SEDAN), *rows), 50.0)
    assert [SIGN_TYPES[index] for index in found["sign"]] == ["works", "accident"]
