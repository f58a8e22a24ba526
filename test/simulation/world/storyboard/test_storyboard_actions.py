"""Each action of a storyboard on a straight road, with positions by hand."""

import datetime
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from storyboard_stage import (
    LANE_M,
    Y_FAR_RIGHT,
    Y_LEFT,
    Y_RIGHT,
    Show,
    after,
    car,
    dynamics,
    event,
    follow,
    lane,
    narrowing,
    person,
    placed,
    polyline,
    speed,
    story,
    storyboard,
    straight,
    world,
)

from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.scene.storyboard import model
from simbev_ros.scene.storyboard.environment import weather_of
from simbev_ros.scene.storyboard.model import Element

CM = 0.01
Play = Callable[..., Show]


@pytest.fixture
def play(tmp_path: Path) -> Play:
    """Plays actions of the ego, each as an event that starts at 1 s, beside another car 50 m ahead of it."""

    def run(*parts: Element, v: float = 10.0, other_v: float = 0.0, at: Element | None = None) -> Show:
        events = [event(f"e{k}", after(1.0), part, priority="parallel") for k, part in enumerate(parts)]
        board = storyboard(
            placed("ego", at or lane(100.0), v), placed("other", lane(150.0), other_v), story(["ego"], *events)
        )
        return Show(straight(tmp_path), [car("ego"), car("other")], board, {"p": "3", "text": "a"})

    return run


def test_an_entity_whose_lane_ends_within_the_road_drives_straight_ahead(tmp_path: Path) -> None:
    show = Show(narrowing(tmp_path), [car("ego")], storyboard(placed("ego", lane(80.0, -2), 10.0)))
    show.run_to(4.0)
    assert show.xy("ego") == pytest.approx((120.0, Y_FAR_RIGHT), abs=CM)
    assert show["ego"].has_left_road


def test_speed_relative_to_another_entity(play: Play) -> None:
    target = model.RelativeTargetSpeed(
        entity_ref="other", value=1.5, speed_target_value_type="factor", continuous=False
    )
    show = play(model.SpeedAction(dynamics=dynamics("linear", "time", 2.0), target=target), other_v=8.0)
    show.run_to(4.0)  # 10 m/s for 1 s, 10 to 12 in 2 s, 12 for 1 s
    assert show["ego"].speed_mps == pytest.approx(12.0)
    assert show.xy("ego")[0] == pytest.approx(100.0 + 10.0 + 22.0 + 12.0, abs=CM)


def test_speed_that_follows_another_one_does_not_end(play: Play) -> None:
    target = model.RelativeTargetSpeed(entity_ref="other", value=2.0, speed_target_value_type="delta", continuous=True)
    show = play(model.SpeedAction(dynamics=dynamics(), target=target), other_v=5.0)
    show.run_to(3.0)
    assert show["ego"].speed_mps == 7.0
    assert show.times("end", "e0") == []


def test_speed_that_follows_another_one_is_reached_by_its_dynamics(play: Play) -> None:
    target = model.RelativeTargetSpeed(entity_ref="other", value=2.0, speed_target_value_type="delta", continuous=True)
    show = play(model.SpeedAction(dynamics=dynamics("linear", "rate", 1.5), target=target), other_v=5.0)
    show.run_to(2.0)  # from 10 to 7 m/s in 2 s
    assert show["ego"].speed_mps == pytest.approx(8.5)
    show.run_to(4.0)
    assert show["ego"].speed_mps == 7.0
    assert show.xy("ego")[0] == pytest.approx(100.0 + 10.0 + 17.0 + 7.0, abs=CM)
    assert show.times("end", "e0") == []


def test_speed_over_a_distance(play: Play) -> None:
    show = play(speed(20.0, "linear", "distance", 30.0))
    show.run_to(3.0)  # 30 m at 15 m/s on average
    assert show.xy("ego")[0] == pytest.approx(100.0 + 10.0 + 30.0, abs=CM)
    assert show["ego"].speed_mps == pytest.approx(20.0)


def test_speed_profile(play: Play) -> None:
    entries = [(0.0, 2.0), (0.0, 1.0), (6.0, 3.0)]
    profile = model.SpeedProfileAction(
        entity_ref=None,
        following_mode="position",
        dynamic_constraints=None,
        entries=tuple(model.SpeedProfileEntry(speed_mps=v, time_s=t) for v, t in entries),
    )
    show = play(profile)
    for time_s, along_m in (
        (2.0, 10 + 7.5),
        (3.0, 10 + 10),
        (4.0, 10 + 10),
        (6.0, 10 + 10 + 4.0),
        (8.0, 20 + 9.0 + 6.0),
    ):
        show.run_to(time_s)
        assert show.xy("ego")[0] == pytest.approx(100.0 + along_m, abs=CM)


def test_lane_change_keeps_an_offset_in_the_target_lane(play: Play) -> None:
    action = model.LaneChangeAction(
        target_lane_offset_m=0.5, dynamics=dynamics("cubic", "time", 2.0), target=model.AbsoluteTargetLane(value=-2)
    )
    show = play(action)
    show.run_to(2.0)
    assert show.xy("ego")[1] == pytest.approx((Y_RIGHT + Y_FAR_RIGHT + 0.5) / 2.0, abs=CM)
    show.run_to(4.0)
    width_m, part = Y_RIGHT - Y_FAR_RIGHT - 0.5, (np.arange(10_000) + 0.5) / 10_000
    along_mps = np.sqrt(10.0**2 - (width_m * 3.0 * part * (1.0 - part)) ** 2)  # 10 m/s is the speed in all
    assert show.xy("ego") == pytest.approx((120.0 + 2.0 * along_mps.mean(), Y_FAR_RIGHT + 0.5), abs=CM)


def test_lane_change_of_an_oncoming_car_is_seen_from_it(play: Play) -> None:
    action = model.LaneChangeAction(dynamics=dynamics(), target=model.RelativeTargetLane(entity_ref="ego", value=1))
    show = play(action, at=lane(300.0, 1))  # it drives towards smaller s; on its left are the lanes -1 and -2
    show.run_to(2.0)
    assert show.xy("ego") == pytest.approx((280.0, Y_RIGHT), abs=CM)


def test_lane_offset_with_a_lateral_acceleration(play: Play) -> None:
    action = model.LaneOffsetAction(
        continuous=False,
        dynamics=model.LaneOffsetActionDynamics(
            dynamics_shape="sinusoidal", max_lateral_acc_mps2=0.5 * math.pi**2 / 4.0
        ),
        target=model.AbsoluteTargetLaneOffset(value_m=-1.0),
    )
    show = play(action)  # π² d / (2 T²) = a with d = 1 m: T = 2 s
    show.run_to(2.0)
    assert show.xy("ego")[1] == pytest.approx(Y_RIGHT - 0.5, abs=CM)
    show.run_to(3.05)
    assert show.xy("ego")[1] == pytest.approx(Y_RIGHT - 1.0, abs=CM)
    assert show.times("end", "e0") == [pytest.approx(3.0, abs=0.051)]


def test_relative_lane_offset_at_once(play: Play) -> None:
    target = model.RelativeTargetLaneOffset(entity_ref="other", value_m=0.75)
    how = model.LaneOffsetActionDynamics(dynamics_shape="step")
    show = play(model.LaneOffsetAction(continuous=True, dynamics=how, target=target))
    show.run_to(2.0)
    assert show.xy("ego")[1] == pytest.approx(Y_RIGHT + 0.75, abs=CM)
    assert show.times("end", "e0") == []


def keep_distance(**fields: object) -> Element:
    return model.LongitudinalDistanceAction(entity_ref="other", freespace=True, continuous=False, **fields)


def test_longitudinal_distance_is_reached_within_limits(play: Play) -> None:
    limits = model.DynamicConstraints(max_acceleration_mps2=2.0, max_deceleration_mps2=3.0, max_speed_mps=30.0)
    show = play(keep_distance(distance_m=20.0, dynamic_constraints=limits), v=10.0, other_v=15.0)
    before = show["ego"].speed_mps
    for tick in range(1, 601):
        show.run_to(tick * 0.05)
        now = show["ego"].speed_mps
        assert -3.0 * 0.05 - 1e-9 <= now - before <= 2.0 * 0.05 + 1e-9
        before = now
    assert show.xy("other")[0] - show.xy("ego")[0] == pytest.approx(20.0 + 4.0, abs=0.02)
    assert show["ego"].speed_mps == pytest.approx(15.0, abs=0.05)
    assert len(show.times("end", "e0")) == 1


def test_longitudinal_distance_without_limits_holds_at_once(play: Play) -> None:
    show = play(keep_distance(time_gap_s=2.0), v=10.0, other_v=10.0)
    show.run_to(1.1)
    assert show.xy("other")[0] - show.xy("ego")[0] == pytest.approx(20.0 + 4.0, abs=CM)


def test_lateral_distance(play: Play) -> None:
    limits = model.DynamicConstraints(max_speed_mps=0.5)
    action = model.LateralDistanceAction(
        entity_ref="other", distance_m=1.0, freespace=False, continuous=False, displacement="rightToReferencedEntity",
        dynamic_constraints=limits,
    )  # fmt: skip
    show = play(action)
    show.run_to(2.0)
    assert show.xy("ego")[1] == pytest.approx(Y_RIGHT - 0.5, abs=CM)
    show.run_to(4.0)
    assert show.xy("ego")[1] == pytest.approx(Y_RIGHT - 1.0, abs=CM)


def test_synchronize_reaches_the_position_with_a_final_speed(play: Play) -> None:
    final = model.AbsoluteSpeed(value_mps=20.0)
    action = model.SynchronizeAction(
        master_entity_ref="other", target_position_master=lane(250.0), target_position=lane(200.0), final_speed=final
    )
    show = play(action, v=10.0, other_v=10.0)  # from 1 s on the other one has 90 m, the ego 90 m, in 9 s
    show.run_to(1.0)
    d, w, v, T = 90.0, 20.0, 10.0, 9.0
    for second in range(2, 10):
        show.run_to(second)
        t = second - 1.0
        b, c = (3.0 * d / T - 2.0 * v - w) / T, (v + w - 2.0 * d / T) / T**2
        assert show.xy("ego")[0] == pytest.approx(110.0 + v * t + b * t**2 + c * t**3, abs=CM)
    show.run_to(10.1)
    assert show["ego"].speed_mps == pytest.approx(20.0)
    assert show.xy("ego")[0] == pytest.approx(200.0 + 0.1 * 20.0, abs=CM)
    assert len(show.times("end", "e0")) == 1


def test_trajectory_at_the_own_speed_with_an_offset(play: Play) -> None:
    action = follow(polyline((110.0, Y_RIGHT), (140.0, Y_RIGHT + 40.0), (200.0, Y_RIGHT + 40.0)))
    show = play(action)
    show.run_to(3.0)
    assert show.xy("ego") == pytest.approx((110.0 + 12.0, Y_RIGHT + 16.0), abs=CM)  # 20 m along 3 : 4
    show.run_to(7.0)
    assert show.xy("ego") == pytest.approx((150.0, Y_RIGHT + 40.0), abs=CM)


def test_trajectory_in_the_time_of_the_scene(play: Play) -> None:
    line = polyline((110.0, Y_RIGHT), (150.0, Y_RIGHT), (150.0, 8.25), times_s=(0.0, 2.0, 4.0))
    show = play(follow(line, model.Timing(domain_absolute_relative="absolute", scale=2.0, offset_s=1.0)))
    for time_s, expected in ((3.0, (130.0, Y_RIGHT)), (5.0, (150.0, Y_RIGHT)), (7.0, (150.0, Y_RIGHT + 5.0))):
        show.run_to(time_s)
        assert show.xy("ego") == pytest.approx(expected, abs=CM)
    assert show["ego"].speed_mps == pytest.approx(2.5)


def test_nurbs_of_a_quarter_of_a_circle(play: Play) -> None:
    corners = [(110.0, Y_RIGHT, 1.0), (130.0, Y_RIGHT, math.sqrt(0.5)), (130.0, Y_RIGHT + 20.0, 1.0)]
    points = tuple(model.ControlPoint(position=world(x, y), weight=w) for x, y, w in corners)
    knots = tuple(model.Knot(value=float(k)) for k in (0, 0, 0, 1, 1, 1))
    shape = model.Nurbs(order=3, control_points=points, knots=knots)
    show = play(follow(model.Trajectory(name="arc", closed=False, shape=shape)))
    show.run_to(3.0)  # 20 m along a circle of 20 m: 1 rad
    expected = 110.0 + 20.0 * math.sin(1.0), Y_RIGHT + 20.0 * (1.0 - math.cos(1.0))
    assert show.xy("ego") == pytest.approx(expected, abs=CM)
    assert show["ego"].yaw_rad == pytest.approx(1.0, abs=0.01)


def test_clothoid_spline_of_two_straight_segments_and_an_arc(play: Play) -> None:
    segments = (
        model.ClothoidSplineSegment(
            curvature_start_per_m=0.0, curvature_end_per_m=0.0, length_m=10.0, position=world(110.0, Y_RIGHT)
        ),
        model.ClothoidSplineSegment(curvature_start_per_m=0.1, curvature_end_per_m=0.1, length_m=5.0 * math.pi),
    )
    shape = model.ClothoidSpline(segments=segments)
    show = play(follow(model.Trajectory(name="spline", closed=False, shape=shape)))
    show.run_to(3.0)  # 10 m straight, 10 m along a circle of 10 m
    expected = 120.0 + 10.0 * math.sin(1.0), Y_RIGHT + 10.0 * (1.0 - math.cos(1.0))
    assert show.xy("ego") == pytest.approx(expected, abs=CM)


def test_acquired_position_off_the_road_is_reached_straight(tmp_path: Path) -> None:
    action = model.AcquirePositionAction(position=world(30.0, 40.0))
    show = Show(
        straight(tmp_path),
        [person("walker")],
        storyboard(placed("walker", world(0.0, 0.0, 1.5), 5.0), story(["walker"], event("go", after(0.0), action))),
    )
    show.run_to(4.0)
    assert show.xy("walker") == pytest.approx((12.0, 16.0), abs=CM)
    show.run_to(11.0)
    assert show.times("end", "go") == [pytest.approx(10.0, abs=0.051)]


def test_teleport_visibility_and_lights(play: Play) -> None:
    light = model.LightStateAction(
        light=model.VehicleLight(vehicle_light_type="highBeam"), state=model.LightState(mode="on")
    )
    hidden = model.VisibilityAction(graphics=False, sensors=False, traffic=True)
    show = play(model.TeleportAction(position=lane(400.0, 1)), hidden, light)
    show.run_to(1.0)
    assert show.xy("ego") == pytest.approx((400.0, Y_LEFT), abs=CM)
    show.run_to(2.0)
    assert show.xy("ego") == pytest.approx((390.0, Y_LEFT), abs=CM)
    assert show.stage.hidden == {"ego"}
    assert show.stage.lights == {("ego", "highBeam"): "on"}


def test_values_entities_and_controllers(play: Play) -> None:
    show = play(
        model.ParameterAction(parameter_ref="text", change=model.SetAction(value="b")),
        model.VariableAction(variable_ref="p", change=model.ModifyAction(rule=model.AddValue(value=2.0))),
        model.VariableAction(variable_ref="p", change=model.ModifyAction(rule=model.MultiplyByValue(value=10.0))),
        model.EntityAction(entity_ref="other", change=model.DeleteEntityAction()),
        model.ActivateControllerAction(lateral=True, longitudinal=True),
        model.AssignControllerAction(),
    )
    show.run_to(1.0)
    assert show.stage.values == {"p": "50.0", "text": "b"}
    assert not show["other"].is_present
    assert show.times("end", "e4") == show.times("end", "e5") == [1.0]


def test_an_entity_is_added_again(play: Play) -> None:
    show = play(
        model.EntityAction(entity_ref="other", change=model.DeleteEntityAction()),
        model.EntityAction(entity_ref="other", change=model.AddEntityAction(position=lane(7.0))),
    )
    show.run_to(1.0)
    assert show["other"].is_present
    assert show.xy("other") == pytest.approx((7.0, Y_RIGHT))


def test_route_is_that_of_its_waypoints(play: Play) -> None:
    points = tuple(model.Waypoint(route_strategy="shortest", position=lane(s)) for s in (120.0, 500.0))
    show = play(model.AssignRouteAction(route=model.Route(name="r", closed=False, waypoints=points)))
    show.run_to(1.0)
    assert show["ego"].route == ("1",)


def test_weather_and_date(play: Play) -> None:
    noon = datetime.datetime(2026, 6, 21, 12, tzinfo=datetime.UTC)
    environment = model.Environment(
        name="fog",
        time_of_day=model.TimeOfDay(animation=True, date_time=noon),
        weather=model.Weather(
            fractional_cloud_cover="fourOktas",
            fog=model.Fog(visual_range_m=94.0),
            precipitation=model.Precipitation(precipitation_type="rain", precipitation_intensity_mmph=0.0),
            wind=model.Wind(direction_rad=0.0, speed_mps=10.0),
        ),
        road_condition=model.RoadCondition(friction_scale_factor=1.0, wetness="wetWithPuddles"),
    )
    show = play(model.EnvironmentAction(environment=environment))
    show.run_to(3.0)
    assert show.stage.date_time == noon + datetime.timedelta(seconds=2)
    values = weather_of(environment, MapDatum(48.0, 9.0, 0.0))
    assert values["sun_altitude_deg"] == pytest.approx(90.0 - 48.0 + 23.44, abs=0.1)
    assert values["fog_density"] == pytest.approx(100.0, abs=1.0)  # a visibility of 94 m, see scene.air
    assert (values["cloudiness"], values["precipitation"], values["wind_intensity"]) == (50.0, 0.0, 50.0)
    assert (values["wetness"], values["precipitation_deposits"]) == (80.0, 50.0)


def test_an_action_takes_the_place_of_another_one_of_its_kind(play: Play) -> None:
    show = play(speed(0.0, "linear", "time", 10.0), speed(30.0, "linear", "rate", 5.0))
    show.run_to(2.0)
    assert show["ego"].speed_mps == pytest.approx(15.0)
    assert show.times("end", "e0") == [pytest.approx(1.05)]


def test_lane_width() -> None:
    assert Y_LEFT - Y_RIGHT == LANE_M
