import math

import numpy as np
import pytest
from synthetic_world import EGO_ID, actor, box_model, world

from simbev_ros.foundation.semantics import BOX_CLASSES, Tag
from simbev_ros.scene.blueprints import blueprint_index
from simbev_ros.schema.boxes import BOX_DTYPE
from simbev_ros.simulation.annotation.boxes.boxes import boxes_around_ego

CAR = box_model(Tag.CAR, (4.0, 2.0, 1.5))
SEDAN = blueprint_index()["vehicle.sedan"]
VAN = blueprint_index()["vehicle.van"]
RIDER = blueprint_index()["rider.bicycle"]


def test_columns_are_aligned_and_have_point_cloud_types() -> None:
    assert BOX_DTYPE.fields is not None
    for kind, offset, *_ in BOX_DTYPE.fields.values():
        assert kind.str[1:] in {"u1", "u2", "u4", "i4", "f4", "f8"}
        assert offset % kind.itemsize == 0


def test_a_box_copies_its_actors_columns_and_its_center_is_half_its_height_up() -> None:
    other = actor(
        CAR,
        VAN,
        id=9,
        x=3.0,
        y=4.0,
        z=1.0,
        yaw=0.7,
        vx=2.0,
        ay=-1.0,
        wz=0.3,
        color=0x123456,
        lights=5,
        doors=2,
        parent=4,
    )
    (found,) = boxes_around_ego(world(actor(CAR, SEDAN), other), 50.0)
    assert (found["x"], found["y"], found["z"]) == (3.0, 4.0, 1.75)
    for name in (
        "id",
        "yaw",
        "vx",
        "ay",
        "wz",
        "length",
        "width",
        "height",
        "color",
        "lights",
        "doors",
        "parent",
        "tag",
    ):
        assert found[name] == other[name][0]
    assert BOX_CLASSES[found["class"]] == "truck"
    assert found["blueprint"] == VAN


def test_the_center_of_a_tilted_box_is_offset_along_its_own_z() -> None:
    (found,) = boxes_around_ego(world(actor(CAR, SEDAN), actor(CAR, SEDAN, id=9, x=8.0, roll=math.pi / 2)), 50.0)
    assert (found["x"], found["y"], found["z"]) == pytest.approx((8.0, -0.75, 0.0), abs=1e-6)


def test_angle_is_positive_to_the_left_of_the_ego() -> None:
    ego = actor(CAR, SEDAN, x=100.0, y=50.0, yaw=math.pi / 2)
    state = world(ego, actor(CAR, SEDAN, id=8, x=90.0, y=50.0), actor(CAR, SEDAN, id=9, x=103.0, y=54.0))
    found = boxes_around_ego(state, 50.0)
    assert list(found["id"]) == [8, 9]
    assert found["angle"] == pytest.approx([math.pi / 2, -math.atan2(3.0, 4.0)])
    assert found["distance"] == pytest.approx([10.0, 5.0])


def test_ego_riders_and_actors_out_of_range_have_no_box() -> None:
    near, far = actor(CAR, SEDAN, id=3, x=19.9), actor(CAR, SEDAN, id=5, x=20.1)
    rider = actor(CAR, RIDER, id=4, x=2.0)
    found = boxes_around_ego(world(actor(CAR, SEDAN, id=EGO_ID), near, far, rider), 20.0)
    assert list(found["id"]) == [3]
    assert found.dtype == BOX_DTYPE
    assert len(boxes_around_ego(world(actor(CAR, SEDAN)), 20.0)) == 0
    assert np.isfinite(found["angle"]).all()
