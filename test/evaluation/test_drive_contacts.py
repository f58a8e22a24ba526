"""Contacts of footprints, boxes and meshes against other algorithms for the same question."""

import numpy as np
import pytest
import shapely
from drive_cases import EGO_ID, TICK_S, actor, drive, network, spec, state, straight
from synthetic_world import ball, box, mesh, sheet, static_scene

from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.evaluation.driving.infractions import Infraction, InfractionKind
from simbev_ros.evaluation.driving.moment import Moment
from simbev_ros.evaluation.driving.referee import Referee
from simbev_ros.evaluation.driving.rules.collisions import touched
from simbev_ros.evaluation.driving.rules.time_to_collision import times_to_collision_s
from simbev_ros.evaluation.driving.static_world import SolidMesh, solid_triangles_m, triangles_touch_box
from simbev_ros.foundation.geometry.footprints import footprints_overlap, rectangle_corners
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.scene.blueprints import blueprint_index


def test_footprints_overlap_where_their_polygons_do() -> None:
    rng = np.random.default_rng(1)
    position_m, yaw_rad = rng.uniform(-3, 3, (3000, 2, 2)), rng.uniform(-4, 4, (3000, 2))
    size_m = rng.uniform(0.3, 4.0, (3000, 2, 2))
    corners = [rectangle_corners(position_m[:, k], yaw_rad[:, k], size_m[:, k]) for k in (0, 1)]
    polygons = [shapely.polygons(each) for each in corners]
    found = footprints_overlap(position_m, yaw_rad, size_m)
    clear = shapely.distance(*polygons) > 1e-9
    assert 500 < clear.sum() < 2500
    assert np.array_equal(found, ~clear)
    assert shapely.area(polygons[0]) == pytest.approx(size_m[:, 0].prod(axis=1))


def test_actors_are_touched_where_their_polygons_are_within_the_gap_and_their_heights_overlap() -> None:
    rng = np.random.default_rng(2)
    rows = []
    for number in range(400):
        x_m, y_m, yaw_rad = rng.uniform(-5, 5), rng.uniform(-5, 5), rng.uniform(-3, 3)
        row = actor(2 + number, straight(0.0, x_m, y_m, yaw_rad), 0.0, size_m=rng.uniform(0.4, 4.0, 3))
        row["z"] = rng.uniform(-3, 3)
        rows.append(row)
    moment = Moment(state(spec(), 0, [actor(EGO_ID, straight(0.0, 0.3, 0.2, 0.4), 0.0), *rows]), TICK_S, None, 0.0)
    others = moment.others
    expected = [
        moment.footprint.intersects(
            shapely.Polygon(
                rectangle_corners(
                    np.array([[row["x"], row["y"]]]),
                    np.array([float(row["yaw"])]),
                    np.array([[row["length"], row["width"]]], np.float64),
                )[0]
            )
        )
        and -row["height"] < row["z"] < 1.5
        for row in others
    ]
    assert 40 < sum(expected) < 300
    assert touched(moment, 0.0).tolist() == expected


def test_time_to_collision_is_the_first_step_at_which_moved_polygons_meet() -> None:
    rng = np.random.default_rng(3)
    ego = actor(EGO_ID, straight(8.0, 0.0, 0.0, 0.3), 0.0)
    rows = np.stack(
        [actor(2 + k, straight(v, x, y, yaw), 0.0) for k, (v, x, y, yaw) in enumerate(rng.uniform(-12, 12, (300, 4)))]
    )
    moment = Moment(state(spec(), 0, [ego, *rows]), TICK_S, None, 0.0)
    found = times_to_collision_s(moment, rows)
    expected = []
    for row in rows:
        times = [
            step * 0.1
            for step in range(31)
            if shapely.intersects(
                *(
                    shapely.Polygon(
                        rectangle_corners(
                            np.array([[each["x"] + each["vx"] * step * 0.1, each["y"] + each["vy"] * step * 0.1]]),
                            np.array([float(each["yaw"])]),
                            np.array([[4.0, 2.0]]),
                        )[0]
                    )
                    for each in (ego, row)
                )
            )
        ]
        expected.append(min(times, default=np.inf))
    assert 50 < np.isfinite(expected).sum() < 250
    assert found == pytest.approx(expected)


def clipped_area_exists(corners_m: Float64Array, half_m: Float64Array) -> bool:
    """Whether anything of a triangle is left after clipping it with the six sides of a box."""
    polygon = list(corners_m)
    for axis in range(3):
        for sign in (1.0, -1.0):
            kept = []
            for here, there in zip(polygon, [*polygon[1:], *polygon[:1]], strict=True):
                a, b = half_m[axis] - sign * here[axis], half_m[axis] - sign * there[axis]
                if a >= 0:
                    kept.append(here)
                if a * b < 0:
                    kept.append(here + (there - here) * a / (a - b))
            polygon = kept
    return bool(polygon)


def test_triangles_touch_a_box_where_clipping_leaves_something() -> None:
    rng = np.random.default_rng(4)
    half_m = np.array([2.0, 1.0, 0.7])
    corners_m = rng.uniform(-3, 3, (3000, 1, 3)) + rng.normal(0, 1.2, (3000, 3, 3))
    expected = [clipped_area_exists(each, half_m) for each in corners_m]
    assert 300 < sum(expected) < 2000
    assert triangles_touch_box(corners_m, half_m).tolist() == expected


def test_an_ego_hits_a_pole_once_and_is_at_fault_but_not_curbs_leaves_and_what_hangs_above() -> None:
    pole = mesh(box([60.0, -1.75, 1.0], [0.2, 0.2, 2.0]), Tag.POLE)
    curb = mesh(box([30.0, -1.75, 0.06], [1.0, 4.0, 0.12]), Tag.STATIC)
    sign = mesh(box([40.0, -1.75, 4.0], [0.2, 4.0, 1.0]), Tag.TRAFFIC_SIGN)
    road = mesh(sheet((0.0, -4.0), (100.0, 4.0), 0.5), Tag.ROAD)
    far = mesh(ball([50.0, 200.0, 1.0], 1.0), Tag.STATIC)
    static = static_scene(pole, curb, sign, road, far, origin_m=(5.0, 0.0, 0.0))
    corridor = shapely.LineString([(10, -1.75), (310, -1.75)]).buffer(30.0)
    triangles_m = solid_triangles_m(static, corridor)
    assert len(triangles_m) == 36
    scene = spec()
    referee = Referee(scene, network(), SolidMesh(triangles_m))
    found = drive(straight(10.0), 10.0, scene, referee=referee)[1]
    hits = [each for each in found if each.kind is InfractionKind.STATIC_COLLISION]
    assert [(each.at_fault, each.other) for each in hits] == [(True, "")]
    assert hits[0].position_m[0] == pytest.approx(65.0 - 0.1 - 2.0, abs=0.5)
    assert hits[0].value == pytest.approx(10.0)


@pytest.mark.parametrize(("door", "side"), [(0, 1.0), (1, -1.0)])
def test_an_ego_that_passes_a_parked_car_hits_its_door_only_if_that_is_open_and_reaches_the_ego(
    door: int, side: float
) -> None:
    car = load_models()[blueprint_index()["vehicle.sedan"]]
    (part,) = [part for part, each in enumerate(car.parts) if each.opening_rad and each.door == door]
    # The door by hand: its vertices at rest, turned about the hinge by 65 degrees, outward at its rear end.
    angle_rad, (hinge_x_m, hinge_y_m, _) = np.radians(-65.0 * side), car.parts[part].pivot_m
    at_rest_m = car.mesh.vertices[car.mesh.part == part] - [hinge_x_m, hinge_y_m, 0.0]
    x_m, y_m = np.array([[np.cos(angle_rad), -np.sin(angle_rad)], [np.sin(angle_rad), np.cos(angle_rad)]]) @ (
        at_rest_m[:, :2].T
    )
    is_hittable = (at_rest_m[:, 2] > 0.3) & (at_rest_m[:, 2] < 1.5)
    tip = int(np.argmax(np.where(is_hittable, side * y_m, -np.inf)))
    tip_m = 60.0 + hinge_x_m + x_m[tip], side * (hinge_y_m + y_m[tip])
    assert tip_m[1] > car.size_m[1] / 2.0 + 0.4

    def hits(doors: int, gap_m: float) -> list[Infraction]:
        def parked(time_s: float) -> list[Table]:
            row = actor(2, straight(0.0, 60.0, 0.0), time_s, size_m=car.size_m)
            row["blueprint"], row["doors"] = blueprint_index()["vehicle.sedan"], doors
            return [row]

        at = straight(10.0, y_m=side * (tip_m[1] + 1.0 + gap_m))  # the ego is 2 m wide
        found = drive(at, 8.0, spec(start_m=10.0), others=parked)[1]
        return [each for each in found if each.kind is InfractionKind.VEHICLE_COLLISION]

    assert not hits(1 << door, 0.002)
    (hit,) = hits(1 << door, -0.002)
    assert (hit.other, hit.at_fault, hit.value) == ("2", True, pytest.approx(10.0))
    assert 0.0 <= hit.position_m[0] + 2.0 - tip_m[0] < 10.0 * TICK_S  # the first tick at which the ego's front is there
    assert not hits(0, -0.3) and not hits(1 << (1 - door), -0.3)
