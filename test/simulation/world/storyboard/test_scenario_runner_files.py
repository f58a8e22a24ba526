"""Files as the examples of CARLA's ScenarioRunner are: their coordinates, criteria and controllers."""

import logging
import math
from pathlib import Path

import numpy as np
import pytest

from simbev_ros.config.load import load_scenario
from simbev_ros.maps.build import load_network
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.source import map_spec
from simbev_ros.scene.drawing.draw_scene import draw_scene, planned_scenes
from simbev_ros.simulation.world.simulation import Simulation

_CAR = """<ScenarioObject name="{name}"><Vehicle name="vehicle.any" vehicleCategory="car"><ParameterDeclarations/>
<Performance maxSpeed="69.444" maxAcceleration="200" maxDeceleration="10.0"/>
<BoundingBox><Center x="1.5" y="0.0" z="0.9"/><Dimensions width="2.1" length="4.5" height="1.8"/></BoundingBox>
<Axles><FrontAxle maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.8" positionX="3.1" positionZ="0.3"/>
<RearAxle maxSteering="0.0" wheelDiameter="0.6" trackWidth="1.8" positionX="0.0" positionZ="0.3"/></Axles>
<Properties><Property name="type" value="{kind}"/></Properties></Vehicle></ScenarioObject>"""
_PRIVATE = """<Private entityRef="{name}"><PrivateAction><TeleportAction><Position>
<WorldPosition x="{x}" y="{y}" z="0" h="{h}"/></Position></TeleportAction></PrivateAction>
<PrivateAction><ControllerAction><AssignControllerAction><Controller name="{name}Agent"><Properties>
<Property name="module" value="{module}"/></Properties></Controller></AssignControllerAction>
<OverrideControllerValueAction><Throttle value="0" active="false"/><Gear number="0" active="false"/>
</OverrideControllerValueAction></ControllerAction></PrivateAction></Private>"""
_CRITERION = """<Condition name="criteria_{}" delay="0" conditionEdge="rising"><ByValueCondition>
<ParameterCondition parameterRef="{}" value="{}" rule="lessThan"/></ByValueCondition></Condition>"""
_FILE = """<?xml version="1.0"?><OpenSCENARIO>
<FileHeader revMajor="1" revMinor="0" date="2020-03-20T12:00:00" description="CARLA:Lead" author=""/>
<ParameterDeclarations/><CatalogLocations/>
<RoadNetwork><LogicFile filepath="Town01"/><SceneGraphFile filepath=""/></RoadNetwork>
<Entities>{entities}</Entities><Storyboard><Init><Actions>{init}</Actions></Init>
<Story name="MyStory"><Act name="Behavior"><ManeuverGroup maximumExecutionCount="1" name="Sequence">
<Actors selectTriggeringEntities="false"><EntityRef entityRef="adversary"/></Actors><Maneuver name="Lead">
<Event name="Drives" priority="overwrite"><Action name="Drives"><PrivateAction><LongitudinalAction><SpeedAction>
<SpeedActionDynamics dynamicsShape="step" value="20" dynamicsDimension="distance"/>
<SpeedActionTarget><AbsoluteTargetSpeed value="2.0"/></SpeedActionTarget>
</SpeedAction></LongitudinalAction></PrivateAction></Action><StartTrigger><ConditionGroup>
<Condition name="Near" delay="0" conditionEdge="rising"><ByEntityCondition>
<TriggeringEntities triggeringEntitiesRule="any"><EntityRef entityRef="hero"/></TriggeringEntities><EntityCondition>
<RelativeDistanceCondition entityRef="adversary" relativeDistanceType="cartesianDistance" value="40.0"
 freespace="false" rule="lessThan"/></EntityCondition></ByEntityCondition></Condition>
</ConditionGroup></StartTrigger></Event></Maneuver></ManeuverGroup>
<StartTrigger><ConditionGroup><Condition name="Start" delay="0" conditionEdge="rising"><ByValueCondition>
<SimulationTimeCondition value="0" rule="equalTo"/></ByValueCondition></Condition></ConditionGroup></StartTrigger>
<StopTrigger><ConditionGroup>{criteria}</ConditionGroup></StopTrigger></Act></Story>
<StopTrigger><ConditionGroup>{criteria}</ConditionGroup></StopTrigger></Storyboard></OpenSCENARIO>"""
_RIG = "scenarios: [lead.xosc]\ntime: {warm_up_s: 1}\nrig: {sensors: [{type: imu, name: imu}]}\n"


def test_a_file_of_scenario_runner_is_played(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "my.yaml").write_text(_RIG)
    network = load_network(map_spec("Town01"))
    lines_m = [each.centerline_m for each in network.lanes.values() if each.kind is LaneKind.DRIVING]
    line_m = max(lines_m, key=lambda each: float(np.hypot(*(each[1] - each[0])[:2])))
    at_m = np.array([line_m[0] + np.append((line_m[1] - line_m[0])[:2], 0.0) * share for share in (0.1, 0.6)])
    yaw_rad = math.atan2(*(line_m[1] - line_m[0])[1::-1])
    start, lead = (
        _PRIVATE.format(name=name, x=x_m, y=-y_m, h=-yaw_rad, module=module)
        for (name, module), (x_m, y_m, _) in zip(
            (("hero", "external_control"), ("adversary", "vehicle_longitudinal_control")), at_m.tolist(), strict=True
        )
    )
    criteria = _CRITERION.format("CollisionTest", "", "") + _CRITERION.format("DistanceTest", "distance_success", "1")
    cars = _CAR.format(name="adversary", kind="simulation") + _CAR.format(name="hero", kind="ego_vehicle")
    (tmp_path / "lead.xosc").write_text(_FILE.format(entities=cars, init=start + lead, criteria=criteria))
    config = load_scenario(tmp_path / "my.yaml")
    (planned,) = planned_scenes(config)
    with caplog.at_level(logging.INFO):
        spec = draw_scene(config, planned, network)
    assert spec.storyboard is not None
    assert [each.name for each in spec.storyboard.cast] == ["hero", "adversary"]
    assert caplog.text.count("criteria_… of no parameter are criteria of ScenarioRunner, and never hold") == 1
    assert caplog.text.count("CARLA: so y points to the right") == 1
    for name in ("heroAgent", "adversaryAgent"):
        assert caplog.text.count(f"<Controller name='{name}'>: the storyboard itself moves") == 1
    with Simulation(spec, network) as simulation:
        while (state := simulation.step()).tick < 40:
            assert not any(event.type.endswith("stop") for event in state.events)
    speed_mps = np.hypot(state.actors["vx"], state.actors["vy"])
    np.testing.assert_allclose(speed_mps, [0.0, 2.0 * (np.hypot(*(at_m[1] - at_m[0])[:2]) < 40.0)], atol=0.01)
    np.testing.assert_allclose([state.ego["x"], state.ego["y"]], at_m[0, :2], atol=3.0)
    assert math.remainder(float(state.ego["yaw"]) - yaw_rad, math.tau) == pytest.approx(0.0, abs=0.1)
