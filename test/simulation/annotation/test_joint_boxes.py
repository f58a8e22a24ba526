"""Boxes of several agents are joined: every object once, with what all agents see of it and what each of them does."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_world import actor, cart_model, world

from simbev_ros.foundation.types import Table
from simbev_ros.schema.boxes import BOX_DTYPE, blank_boxes
from simbev_ros.schema.scene.state import EGO_ID
from simbev_ros.simulation.annotation.boxes.boxes import boxes_around_ego
from simbev_ros.simulation.annotation.boxes.extents import Extents
from simbev_ros.simulation.annotation.boxes.joint import NOT_LISTED, SHARED_DTYPE, join_boxes, joint_dtype

NAMES = ("ego", "car", "rsu")


def boxes(*rows: dict[str, float]) -> Table:
    """Boxes with these values, whose other columns that all agents share follow from the id."""
    result = blank_boxes(len(rows))
    for box, values in zip(result, rows, strict=True):
        box["x"], box["length"], box["class"] = 10.0 * values["id"], values["id"] / 3.0, values["id"]
        for name, value in values.items():
            box[name] = value
    return result


def made_up_tables() -> dict[str, Table]:
    """The ego (1) and the car (2) see each other and a pedestrian (7) that one of them just lists; rsu sees all."""
    return {
        "ego": boxes(
            {"id": 2, "distance": 9, "angle": 0.5, "lidar_points": 4, "visibility": 0.25, "on_ego_level": 1},
            {"id": 7, "distance": 30, "lidar_points": 0, "visibility": 0.0, "difficulty": 2},
        ),
        "car": boxes(
            {"id": 1, "distance": 9, "lidar_points": 6, "radar_points": 1, "valid": 1},
            {"id": 7, "distance": 12, "lidar_points": 3, "radar_points": 0, "valid": 1, "difficulty": 1},
            {"id": 9, "distance": 100, "lidar_points": 0, "radar_points": 0, "on_ego_level": 1},
        ),
        "rsu": boxes(*({"id": id_, "distance": id_, "visibility": 0.5} for id_ in (1, 2))),
    }


def test_each_object_in_any_table_is_one_row_with_its_shared_columns() -> None:
    tables = made_up_tables()
    joint = join_boxes(NAMES, tables)
    assert not joint.refused
    assert joint.rows["id"].tolist() == [1, 2, 7, 9]
    for table in tables.values():
        rows = joint.rows[np.isin(joint.rows["id"], table["id"])]
        for column in SHARED_DTYPE.names or ():
            assert rows[column].tobytes() == table[column].tobytes()


def test_points_are_summed_and_the_maximum_of_visibilities_is_taken() -> None:
    rows = join_boxes(NAMES, made_up_tables()).rows
    assert rows["lidar_points"].tolist() == [6, 4, 3, 0]
    assert rows["radar_points"].tolist() == [1, -1, 0, 0], "-1: nobody who lists it has received a radar"
    np.testing.assert_array_equal(rows["visibility"], np.float32([0.5, 0.5, 0.0, np.nan]))


def test_bits_say_which_agents_see_an_object_in_the_order_of_the_specification() -> None:
    rows = join_boxes(NAMES, made_up_tables()).rows
    assert rows["seen_by"].tolist() == [0b110, 0b101, 0b010, 0]
    assert rows["seen"].tolist() == [1, 1, 1, 0]


def test_columns_of_an_agent_are_its_own_and_mark_what_it_does_not_list_such_as_its_own_body() -> None:
    rows = join_boxes(NAMES, made_up_tables()).rows
    assert rows["ego.distance"].tolist() == [np.inf, 9, 30, np.inf]
    np.testing.assert_array_equal(rows["ego.angle"], np.float32([np.nan, 0.5, 0, np.nan]))
    np.testing.assert_array_equal(rows["ego.visibility"], np.float32([np.nan, 0.25, 0.0, np.nan]))
    assert rows["ego.lidar_points"].tolist() == [-1, 4, 0, -1]
    assert rows["ego.radar_points"].tolist() == [-1, -1, -1, -1]
    assert rows["ego.on_level"].tolist() == [NOT_LISTED, 1, 0, NOT_LISTED]
    assert rows["ego.difficulty"].tolist() == [NOT_LISTED, 0, 2, NOT_LISTED]
    assert rows["car.distance"].tolist() == [9, np.inf, 12, 100]


def test_thirty_two_agents_have_a_bit_each() -> None:
    names = [f"car_{k}" for k in range(32)]
    tables = {name: boxes({"id": 40, "lidar_points": k % 31 == 0}) for k, name in enumerate(names)}
    assert join_boxes(names, tables).rows["seen_by"].tolist() == [1 | 1 << 31]


def test_agents_without_boxes_or_messages_leave_the_others_as_they_are() -> None:
    alone = join_boxes(NAMES, {"ego": made_up_tables()["ego"]}).rows
    empty = join_boxes(NAMES, {name: boxes() for name in NAMES} | {"ego": made_up_tables()["ego"]}).rows
    assert alone.tobytes() == empty.tobytes()
    assert alone["car.distance"].tolist() == [np.inf, np.inf]
    assert join_boxes(NAMES, {}).rows.dtype == joint_dtype(NAMES)


@pytest.mark.parametrize("column", ["x", "yaw", "class", "lights"])
def test_a_table_that_contradicts_an_earlier_one_is_refused(column: str) -> None:
    tables = made_up_tables()
    tables["car"][column][1] = np.nextafter(tables["car"][column][1], 99) if column in "x yaw" else 99
    joint = join_boxes(NAMES, tables)
    assert joint.refused == {"car": f"{column} of object 7 is not the one that another agent has"}
    without = {name: table for name, table in tables.items() if name != "car"}
    assert joint.rows.tobytes() == join_boxes(NAMES, without).rows.tobytes()


def test_a_table_with_an_object_twice_is_refused() -> None:
    assert join_boxes(NAMES, {"ego": boxes({"id": 3}, {"id": 3})}).refused == {"ego": "ids are not ascending"}


def test_the_columns_of_boxes_are_either_shared_or_those_of_an_observer() -> None:
    observed = {"distance", "angle", "visibility", "lidar_points", "radar_points", "on_ego_level", "valid"}
    assert {*(SHARED_DTYPE.names or ()), *observed, "difficulty"} == {*(BOX_DTYPE.names or ())}
    assert len(joint_dtype(NAMES).names or ()) == len(SHARED_DTYPE.names or ()) + 5 + 3 * 7


def test_boxes_around_different_actors_never_contradict_each_other() -> None:
    rng, models = np.random.default_rng(5), (cart_model(),)
    turns = {name: rng.uniform(-3, 3, 60) for name in ("roll", "pitch", "yaw")}
    places = rng.normal(0, 60, (60, 2))
    actors = [
        actor(models[0], id=k + 1, x=x, y=y, **{name: each[k] for name, each in turns.items()})
        for k, (x, y) in enumerate(places.tolist())
    ]
    for radius_m in (30.0, 55.0, 80.0):
        tables = {}
        for index, name in enumerate(NAMES):
            seen = replace(world(*actors), ego_id=EGO_ID + index)
            tables[name] = boxes_around_ego(seen, radius_m * (1 + index / 3), extents=Extents(models))
        joint = join_boxes(NAMES, tables)
        assert not joint.refused
        assert joint.rows["id"].tolist() == sorted({int(id_) for table in tables.values() for id_ in table["id"]})
