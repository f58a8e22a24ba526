import math
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from synthetic_world import EGO_ID, actor, box_model, world

from simbev_ros.annotation.boxes.boxes import LIGHT_IDS, NO_BLUEPRINT, SIGN_IDS, boxes
from simbev_ros.annotation.boxes.standing import standing_of
from simbev_ros.assets.regions.build import build_region
from simbev_ros.assets.street.signs import street_name_sign
from simbev_ros.geometry.transforms import rotations_from_rpy
from simbev_ros.maps.build import load_network
from simbev_ros.maps.land.terrain import Terrain
from simbev_ros.maps.network import RoadNetwork, Signal
from simbev_ros.maps.region import REGION_M, Region
from simbev_ros.maps.roads.layout import Sign, SignKind
from simbev_ros.maps.source import map_spec
from simbev_ros.scene.blueprints import blueprint_index
from simbev_ros.scene.state import SIGNAL_DTYPE, SignalState, WorldState
from simbev_ros.semantics import BOX_CLASSES, SIGN_TYPES, Tag
from simbev_ros.types import Float64Array

CENTIMETRE = 0.01
CARLA = Path(__file__).parents[3] / "shared" / "maps" / "carla" / "Town01.xodr"
TOWNS = [
    ("Town03", Region(-1, -1)),
    ("Town04", Region(-2, -2)),
    ("Town10HD", Region(-1, -1)),
    pytest.param(str(CARLA), Region(0, -1), marks=pytest.mark.skipif(not CARLA.exists(), reason="no CARLA maps")),
]
CAR = box_model(Tag.CAR, (4.0, 2.0, 1.5))
SEDAN = blueprint_index()["vehicle.sedan"]
AT_M = (100.0, 50.0, 2.0)


def vertices_of(network: RoadNetwork, region: Region, tag: Tag) -> Float64Array:
    """(V, 3) all vertices of a tag in the region's tiles, map frame, but for plates with names of streets."""
    names = street_name_sign((28, 92, 64))
    decoration = np.unique(names.color[names.tag == Tag.TRAFFIC_SIGN], axis=0)
    found = []
    for tile in build_region(network, region, Terrain(network)).tiles:
        chosen = tile.mesh.tag == tag
        chosen &= ~(tile.mesh.color[:, None] == decoration).all(axis=2).any(axis=1)
        found.append(tile.mesh.vertices[chosen] + tile.origin_m)
    return np.concatenate(found)


@pytest.mark.parametrize(("town", "region"), TOWNS)
def test_all_lights_and_signs_are_in_their_boxes_and_touch_all_faces(town: str, region: Region) -> None:
    network = load_network(map_spec(town))
    standing = standing_of(network)
    own = (np.floor(standing.foot_m[:, :2] / REGION_M) == region).all(axis=1)
    for tag in Tag.TRAFFIC_LIGHT, Tag.TRAFFIC_SIGN:
        vertices_m = vertices_of(network, region, tag)
        held = np.zeros(len(vertices_m), bool)
        table = standing.boxes[own & (standing.boxes["tag"] == tag)]
        assert len(table)
        for box in table:
            local_m = vertices_m - [box["x"], box["y"], box["z"]]
            local_m = local_m @ rotations_from_rpy(np.array([box["roll"], box["pitch"], box["yaw"]]))
            half_m = np.array([box["length"], box["width"], box["height"]]) / 2.0
            inside = (np.abs(local_m) <= half_m + CENTIMETRE).all(axis=1)
            held |= inside
            np.testing.assert_allclose(local_m[inside].min(axis=0), -half_m, atol=CENTIMETRE)
            np.testing.assert_allclose(local_m[inside].max(axis=0), half_m, atol=CENTIMETRE)
        assert held.all()


@lru_cache(maxsize=1)
def equipped() -> RoadNetwork:
    """A town whose only lights and signs stand in a row to the north, and look east."""
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
    """The ego at the row's southern end, heading north; another car beside it."""
    x, y, z = AT_M
    ego = actor(CAR, SEDAN, id=EGO_ID, x=x, y=y, z=z, yaw=math.pi / 2)
    signals = np.zeros(len(states), SIGNAL_DTYPE)
    signals["id"], signals["state"] = 1 + np.arange(len(states)), states
    return replace(world(ego, actor(CAR, SEDAN, id=900, x=x + 5.0, y=y, z=z)), signals=signals)


def test_lights_and_signs_follow_the_actors_by_id_and_say_what_they_are() -> None:
    state = state_with(SignalState.RED, SignalState.OFF, SignalState.GREEN)
    found = boxes(state, 50.0, standing=standing_of(equipped()))
    lights, signs = LIGHT_IDS + 1 + np.arange(3), SIGN_IDS + 1 + np.arange(3)
    assert found["id"].tolist() == [900, *lights, *signs]
    standing = found[1:]
    assert [BOX_CLASSES[index] for index in standing["class"]] == ["traffic_light"] * 3 + ["traffic_sign"] * 3
    assert standing["tag"].tolist() == [Tag.TRAFFIC_LIGHT] * 3 + [Tag.TRAFFIC_SIGN] * 3
    assert standing["state"].tolist() == [SignalState.RED, SignalState.OFF, SignalState.GREEN, 0, 0, 0]
    assert [SIGN_TYPES[index] for index in standing["sign"]] == ["", "", "", *SignKind]
    assert standing["limit"] == pytest.approx([0.0, 0.0, 0.0, 0.0, 0.0, 30 / 3.6])
    assert (standing["blueprint"] == NO_BLUEPRINT).all()
    assert standing["on_ego_level"].all()
    assert np.isnan(standing["visibility"]).all()
    assert (standing["lidar_points"] == -1).all()
    for name in ("vx", "wz", "ax", "parent", "lights", "doors", "behavior", "valid", "roll", "pitch", "yaw"):
        assert not standing[name].any()


def test_distance_and_angle_of_what_stands_still_are_those_of_actors() -> None:
    found = boxes(state_with(*[SignalState.RED] * 3), 50.0, standing=standing_of(equipped()))
    light = found[found["id"] == LIGHT_IDS + 3][0]
    forward_m, left_m, up_m = light["y"] - AT_M[1], AT_M[0] - light["x"], light["z"] - AT_M[2] - 0.75
    assert forward_m == pytest.approx(10.0)
    assert light["distance"] == pytest.approx(np.linalg.norm([forward_m, left_m, up_m]))
    assert light["angle"] == pytest.approx(math.atan2(left_m, forward_m), abs=1e-6)


def test_only_what_is_within_the_radius_has_a_box() -> None:
    standing = standing_of(equipped())
    found = boxes(state_with(*[SignalState.RED] * 3), 10.5, standing=standing)
    assert found["id"].tolist() == [900, LIGHT_IDS + 1, LIGHT_IDS + 2]
    assert boxes(state_with(), 3.0, standing=standing).shape == (0,)


def test_a_map_without_lights_and_signs_adds_nothing() -> None:
    bare = replace(equipped(), signals=(), layout=replace(equipped().layout, signs=()))
    assert boxes(state_with(), 50.0, standing=standing_of(bare))["id"].tolist() == [900]


def test_signs_that_warn_of_hazards_say_so() -> None:
    rows = [
        actor(box_model(Tag.TRAFFIC_SIGN, (0.8, 0.8, 1.6)), blueprint_index()[f"prop.sign_{name}"], id=20 + k, x=5.0)
        for k, name in enumerate(("works", "accident"))
    ]
    found = boxes(world(actor(CAR, SEDAN), *rows), 50.0)
    assert [SIGN_TYPES[index] for index in found["sign"]] == ["works", "accident"]
