"""A scenario with every action, condition and position of a version of the standard, made by scenariogeneration."""

from pathlib import Path
from typing import Any

from scenariogeneration import xosc

STEP = xosc.TransitionDynamics(xosc.DynamicsShapes.step, xosc.DynamicsDimension.time, 0)
SMOOTH = xosc.TransitionDynamics(xosc.DynamicsShapes.sinusoidal, xosc.DynamicsDimension.rate, 2)
MORE = xosc.Rule.greaterThan
ALONG = xosc.RelativeDistanceType.longitudinal
EUCLIDEAN = xosc.RelativeDistanceType.euclidianDistance
LANE = xosc.LanePosition(50.5, 0.25, -1, 7)
FAST = xosc.RouteStrategy.fastest


def write_generated_scenario(folder: Path, minor: int) -> Path:
    """Write a scenario of a minor version into a folder.

    Every action, condition and position is in it, except for LightStateAction: the library writes it in a wrong order.
    """
    xosc.VersionBase().setVersion(minor=minor)
    parameters, variables = xosc.ParameterDeclarations(), xosc.VariableDeclarations()
    parameters.add_parameter(xosc.Parameter("gap", xosc.ParameterType.double, "30"))
    variables.add_variable(xosc.Variable("mood", xosc.ParameterType.double, "1"))
    network = xosc.RoadNetwork()
    signals = xosc.TrafficSignalController("lights", 0)
    phase = xosc.Phase("go", 20)
    phase.add_signal_state("s1", "green")
    signals.add_phase(phase)
    network.add_traffic_signal_controller(signals)
    init = xosc.Init()
    init.add_init_action("ego", xosc.TeleportAction(LANE))
    init.add_init_action("ego", xosc.AbsoluteSpeedAction("$gap", STEP))
    init.add_global_action(xosc.EnvironmentAction(_environment(minor)))
    storyboard = xosc.StoryBoard(init, _trigger(xosc.SimulationTimeCondition(60, MORE), "stop"))
    maneuver = xosc.Maneuver("maneuver")
    for number, condition in enumerate(_conditions(minor)):
        event = xosc.Event(f"watch{number}", xosc.Priority.parallel)
        event.add_action(f"watching{number}", xosc.TeleportAction(LANE))
        event.add_trigger(_trigger(condition))
        maneuver.add_event(event)
    for number, action in enumerate(_actions(minor)):
        event = xosc.Event(f"act{number}", xosc.Priority.skip, 2)
        event.add_action(f"acting{number}", action)
        event.add_trigger(_trigger(xosc.SimulationTimeCondition(1, MORE)))
        maneuver.add_event(event)
    group = xosc.ManeuverGroup("group")
    group.add_actor("ego")
    group.add_maneuver(maneuver)
    act = xosc.Act("act", _trigger(xosc.SimulationTimeCondition(0, MORE)))
    act.add_maneuver_group(group)
    storyboard.add_act(act)
    scenario = xosc.Scenario(
        *("all", "test", parameters, _entities(), storyboard, network, xosc.Catalog()),
        osc_minor_version=minor,
        **({"variable_declaration": variables} if minor > 1 else {}),
    )
    scenario.write_xml(str(folder / f"generated_{minor}.xosc"))
    return folder / f"generated_{minor}.xosc"


def _trigger(condition: Any, point: str = "start") -> Any:
    arguments = ("condition", 0.5, xosc.ConditionEdge.rising, condition)
    if isinstance(condition, xosc.utils._ValueTriggerType):
        return xosc.ValueTrigger(*arguments, point)
    return xosc.EntityTrigger(*arguments, "ego")


def _entities() -> Any:
    box = xosc.BoundingBox(1.8, 4.5, 1.5, 1.4, 0, 0.75)
    front, rear = xosc.Axle(0.5, 0.6, 1.6, 2.8, 0.3), xosc.Axle(0, 0.6, 1.6, 0, 0.3)
    entities = xosc.Entities()
    controller = xosc.Controller("driver", xosc.Properties())
    car = xosc.Vehicle("car", xosc.VehicleCategory.car, box, front, rear, 60, 5, 9)
    entities.add_scenario_object("ego", car, controller)
    entities.add_scenario_object("other", car)
    person = xosc.Pedestrian("person", 80, xosc.PedestrianCategory.pedestrian, box, "person.glb")
    entities.add_scenario_object("walker", person)
    entities.add_scenario_object("post", xosc.MiscObject("post", 20, xosc.MiscObjectCategory.pole, box))
    return entities


def _environment(minor: int) -> Any:
    clouds = xosc.FractionalCloudCover.twoOktas if minor > 1 else xosc.CloudState.free
    weather = xosc.Weather(
        clouds,
        sun=xosc.Sun(20_000, 1.5, 0.5),
        fog=xosc.Fog(500),
        precipitation=xosc.Precipitation(xosc.PrecipitationType.rain, 0.5),
        **({"wind": xosc.Wind(1, 5), "temperature": 280, "atmosphericPressure": 100_000} if minor else {}),
    )
    moment = xosc.TimeOfDay(True, 2026, 6, 1, 18, 30, 0)
    return xosc.Environment("evening", moment, weather, xosc.RoadCondition(0.8))


def _route() -> Any:
    route = xosc.Route("route")
    route.add_waypoint(LANE, FAST)
    route.add_waypoint(xosc.WorldPosition(10, 20, 0, 0.1, 0, 0), FAST)
    return route


def _trajectory(shape: Any) -> Any:
    trajectory = xosc.Trajectory("course", False)
    trajectory.add_shape(shape)
    return trajectory


def _positions(minor: int) -> list[Any]:
    turned = xosc.Orientation(h=0.5, reference=xosc.ReferenceContext.relative)
    positions = [
        xosc.WorldPosition(1, 2, 3, 0.4, 0.5, 0.6),
        xosc.RelativeWorldPosition("other", 1, 2, 0, turned),
        xosc.RelativeObjectPosition("other", 1, 2, 0),
        xosc.RoadPosition(10, -2, 7),
        xosc.RelativeRoadPosition(10, -2, "other"),
        xosc.RelativeLanePosition(-1, "other", 0.5, 20),
        xosc.RoutePositionOfCurrentEntity(_route(), "other"),
        xosc.RoutePositionInRoadCoordinates(_route(), 1, 2),
        xosc.RoutePositionInLaneCoordinates(_route(), 1, "-1", 0.5),
    ]
    if minor:
        latitude_longitude = (48.1, 11.5) if minor > 1 else (0.84, 0.2)
        positions.append(xosc.GeoPosition(*latitude_longitude))
        positions.append(xosc.TrajectoryPosition(_trajectory(xosc.Polyline([0, 1], [LANE, LANE])), 0))
    return positions


def _actions(minor: int) -> list[Any]:
    nurbs = xosc.Nurbs(3)
    for x_m in range(4):
        nurbs.add_control_point(xosc.ControlPoint(xosc.WorldPosition(x_m, 0), x_m, 1))
    nurbs.add_knots([0, 0, 0, 1, 2, 2, 2])
    shapes = [
        xosc.Polyline([0, 1], [LANE, xosc.WorldPosition(1, 2)]),
        xosc.Clothoid(0.01, 0.001, 100, LANE, 0, 10),
        nurbs,
    ]
    if minor > 2:
        shapes.append(xosc.ClothoidSpline([xosc.ClothoidSplineSegment(0, 0.1, 10, 0, 0)], 5))
    follow = (xosc.FollowingMode.position, xosc.ReferenceContext.relative, 1, 0)
    driver = xosc.Controller("driver", xosc.Properties())
    driver = xosc.ObjectController("driver", controller=driver) if minor > 2 else driver
    controller = xosc.AssignControllerAction(driver, True, True)
    idle = xosc.OverrideControllerValueAction()
    idle.set_brake(False, 0)
    for name in ("throttle", "clutch", "parkingbrake", "steeringwheel"):
        getattr(idle, f"set_{name}")(False, 0)
    idle.set_gear(False, 0)
    actions = [
        xosc.RelativeSpeedAction(5, "other", SMOOTH),
        xosc.LongitudinalDistanceAction("other", max_acceleration=2, distance=20),
        xosc.AbsoluteLaneChangeAction(-2, SMOOTH, 0.1),
        xosc.RelativeLaneChangeAction(1, "other", SMOOTH),
        xosc.AbsoluteLaneOffsetAction(0.5, xosc.DynamicsShapes.linear, 3, False),
        xosc.RelativeLaneOffsetAction(0.5, "other", xosc.DynamicsShapes.linear, 3),
        xosc.LateralDistanceAction("other", 2),
        xosc.AssignRouteAction(_route()),
        xosc.AcquirePositionAction(LANE),
        *(xosc.FollowTrajectoryAction(_trajectory(shape), *follow) for shape in shapes),
        xosc.ControllerAction(controller, idle if minor < 3 else None),
        xosc.VisibilityAction(True, False, True),
        xosc.SynchronizeAction("other", LANE, xosc.WorldPosition(5, 6), final_speed=xosc.AbsoluteSpeed(10)),
        xosc.AddEntityAction("walker", LANE),
        xosc.DeleteEntityAction("walker"),
        xosc.TrafficSignalStateAction("s1", "red"),
        xosc.TrafficSignalControllerAction("go", "lights"),
        *map(xosc.TeleportAction, _positions(minor)),
    ]
    if minor < 2:
        actions += [
            xosc.ParameterSetAction("gap", 3),
            xosc.ParameterAddAction("gap", 3),
            xosc.ParameterMultiplyAction("gap", 3),
        ]
    if minor:
        actions.append(xosc.ControllerAction(activateControllerAction=xosc.ActivateControllerAction(True, False)))
    if minor > 1:
        limits = xosc.DynamicsConstraints(2, 3, 30)
        relative = xosc.RelativeSpeedToMaster(2, xosc.SpeedTargetValueType.delta, xosc.TargetTimeSteadyState(3))
        actions += [
            xosc.SpeedProfileAction([10, 20], xosc.FollowingMode.follow, [1, 2], limits),
            xosc.SynchronizeAction("other", LANE, LANE, 1, 2, relative),
            xosc.VariableSetAction("mood", 3),
            xosc.VariableAddAction("mood", 3),
            xosc.VariableMultiplyAction("mood", 3),
        ]
    return actions


def _conditions(minor: int) -> list[Any]:
    state = (xosc.StoryboardElementType.event, "act0", xosc.StoryboardElementState.endTransition)
    conditions = [
        xosc.EndOfRoadCondition(1),
        xosc.CollisionCondition("other"),
        xosc.CollisionCondition(xosc.ObjectType.pedestrian),
        xosc.OffroadCondition(1),
        xosc.TimeHeadwayCondition("other", 2, MORE, True, False, ALONG),
        xosc.TimeToCollisionCondition(3, MORE, False, True, "other", distance_type=EUCLIDEAN),
        xosc.TimeToCollisionCondition(3, MORE, True, True, position=LANE, distance_type=ALONG),
        xosc.AccelerationCondition(2, MORE),
        xosc.StandStillCondition(2),
        xosc.SpeedCondition(10, MORE),
        xosc.RelativeSpeedCondition(2, MORE, "other"),
        xosc.TraveledDistanceCondition(100),
        xosc.DistanceCondition(10, MORE, LANE, True, True, ALONG),
        xosc.RelativeDistanceCondition(10, MORE, ALONG, "other"),
        xosc.ParameterCondition("gap", 3, MORE),
        xosc.TimeOfDayCondition(MORE, 2026, 6, 1, 19, 0, 0),
        xosc.StoryboardElementStateCondition(*state),
        xosc.UserDefinedValueCondition("key", 3, MORE),
        xosc.TrafficSignalCondition("s1", "green"),
        xosc.TrafficSignalControllerCondition("lights", "go"),
    ]
    if minor < 2:
        conditions.append(xosc.ReachPositionCondition(LANE, 2))
    if minor > 1:
        clearance = xosc.RelativeClearanceCondition(True, 10, 20)
        clearance.add_entity("other")
        clearance.add_relative_lane_range(-1, 1)
        conditions += [xosc.VariableCondition("mood", 3, MORE), clearance]
    if minor > 2:
        angle = (0.5, 0.1, xosc.AngleType.heading, xosc.CoordinateSystem.road)
        conditions.append(xosc.AngleCondition(*angle))
        conditions.append(xosc.RelativeAngleCondition(*angle[:3], "other", angle[3]))
    return conditions
