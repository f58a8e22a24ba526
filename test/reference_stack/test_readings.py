"""Rectangles seen from the origin are read as the right class, heading and visibility."""

import numpy as np
import pytest

from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.reference_stack.box_fit import Rectangles
from simbev_ros.reference_stack.classes import load_kinds
from simbev_ros.reference_stack.readings import Readings, Resolution, read_rectangles

KINDS = load_kinds()
FINE = Resolution(np.radians(0.2), np.radians(0.1))


def _read(sides_m: tuple[float, float], top_m: float, center_m: tuple[float, float]) -> Readings:
    """Read a rectangle along x."""
    one = np.array([1.0])
    rectangle = Rectangles(np.array([center_m]), 0 * one, np.array([sides_m]), top_m * one, 0 * one, np.array([50]))
    return read_rectangles(rectangle, KINDS, np.zeros(2), FINE)


def _cheapest(readings: Readings) -> tuple[str, float]:
    """Class name and length direction of the reading with the lowest cost."""
    _, reading, kind = np.unravel_index(readings.cost.argmin(), readings.cost.shape)
    return KINDS.class_name[kind], float(readings.yaw_rad[0, reading])


@pytest.mark.parametrize(
    ("sides_m", "top_m", "name"),
    [
        ((4.4, 1.95), 1.48, "car"),
        ((5.8, 2.3), 2.6, "truck"),
        ((12.0, 2.8), 3.2, "bus"),
        ((2.1, 0.8), 1.7, "motorcycle"),
        ((1.75, 0.6), 1.75, "bicycle"),
        ((0.6, 0.5), 1.7, "pedestrian"),
        ((0.5, 0.4), 1.3, "pedestrian"),
    ],
)
def test_complete_outlines_are_read_as_their_class(sides_m: tuple[float, float], top_m: float, name: str) -> None:
    assert _cheapest(_read(sides_m, top_m, (7.0, 7.0))) == (name, 0.0)


def test_rear_of_a_car_is_read_as_a_car_along_the_line_of_sight() -> None:
    assert _cheapest(_read((0.1, 1.9), 1.45, (20.0, 0.0))) == ("car", 0.0)
    assert _cheapest(_read((1.9, 0.1), 1.45, (0.0, 20.0))) == ("car", pytest.approx(np.pi / 2))


def test_missing_size_costs_more_in_view_than_hidden() -> None:
    ahead, beside = _read((0.1, 1.9), 1.45, (20.0, 0.0)), _read((0.1, 1.9), 1.45, (0.0, 20.0))
    car = KINDS.class_name.index("car")
    assert ahead.cost[0, 0, car] < 2 < beside.cost[0, 0, car]


def test_sensor_sees_the_near_end_and_both_sides_of_an_object_ahead() -> None:
    readings = _read((4.0, 2.0), 1.5, (10.0, 0.0))
    assert readings.sensor_side[0, 0] == pytest.approx([-1.0, 0.0])
    assert readings.view[0, 0] == pytest.approx([0.0, 1.0])
    assert readings.ring_gap_m == pytest.approx([10.0 * np.radians(0.2)])


def test_readings_are_transformed_with_the_pose_of_the_ego() -> None:
    pose = np.array([[0.0, -1.0, 0.0, 100.0], [1.0, 0.0, 0.0, 50.0], [0.0, 0.0, 1.0, 3.0], [0.0, 0.0, 0.0, 1.0]])
    moved = _read((4.0, 2.0), 1.5, (10.0, 1.0)).in_map(pose)
    assert moved.center_m == pytest.approx(np.array([[99.0, 60.0]]))
    assert moved.ground_m == pytest.approx([3.0])
    assert moved.yaw_rad[0] == pytest.approx([np.pi / 2, np.pi])


def test_class_numbers_are_those_of_the_graph() -> None:
    assert [BOX_CLASSES[number] for number in KINDS.class_number] == list(KINDS.class_name)
