"""Scenes of scenarios in the world: casting, the first agent, lights, signals, what is hidden, and the end."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from storyboard_stage import straight

from simbev_ros.config.load import load_scenario
from simbev_ros.foundation.errors import InputError
from simbev_ros.maps.build import load_network
from simbev_ros.scene.blueprints import load_blueprints
from simbev_ros.scene.drawing.chosen_maps import maps_of
from simbev_ros.scene.drawing.draw_scene import draw_scene, planned_scenes
from simbev_ros.scene.ending import SceneEndDetector
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import EGO_ID, Light, SignalState, WorldState
from simbev_ros.simulation.world.simulation import Simulation

EXAMPLE = Path(__file__).parents[4] / "examples/cut_in.xosc"
RIG = "rig: {sensors: [{type: imu, name: imu}]}\n"
INIT_END = "</Actions>\n    </Init>"
Draw = Callable[..., SceneSpec]


@pytest.fixture
def draw(tmp_path: Path) -> Draw:
    """Draws the scene of the example with changes of its text, and with more configuration."""

    def drawn(*changes: tuple[str, str], more: str = "") -> SceneSpec:
        text = EXAMPLE.read_text()
        for before, after in changes:
            assert before in text
            text = text.replace(before, after)
        (tmp_path / "scenario.xosc").write_text(text)
        (tmp_path / "my.yaml").write_text(f"scenarios: [scenario.xosc]\ntime: {{warm_up_s: 1}}\n{RIG}{more}")
        config = load_scenario(tmp_path / "my.yaml")
        (planned,) = planned_scenes(config)
        return draw_scene(config, planned, load_network(planned.map))

    return drawn


def states(
    spec: SceneSpec, seconds: float | None = None, act: Callable[[Simulation, int], None] | None = None
) -> Iterator[WorldState]:
    """States of a scene from tick 0 to its end, or for some seconds."""
    with Simulation(spec, load_network(spec.map)) as simulation:
        ending = SceneEndDetector(spec, simulation.available)
        while True:
            state = simulation.step()
            if act is not None:
                act(simulation, state.tick)
            if state.tick >= 0:
                yield state
            if ending.end_at(state) or (seconds is not None and state.tick >= seconds * 20):
                return


def names(spec: SceneSpec, state: WorldState) -> list[str]:
    return [load_blueprints()[index].name for index in state.actors["blueprint"]]


def test_entities_are_cast_and_alone(draw: Draw) -> None:
    spec = draw()
    assert spec.storyboard is not None
    assert [(each.name, each.blueprint) for each in spec.storyboard.cast] == [
        ("Ego", "vehicle.sedan"),
        ("Van", "vehicle.van"),
    ]
    assert SceneSpec.model_validate_json(spec.model_dump_json()) == spec
    *_, last = states(spec)
    assert names(spec, last) == ["vehicle.sedan", "vehicle.van"]
    assert last.tick == 140  # 7 s
    assert [event.type for event in last.events] == ["scenario.stop"]


def test_a_scene_without_a_stop_trigger_lasts_as_long_as_the_configuration_says(draw: Draw) -> None:
    spec = draw(('value="7" rule', 'value="1000" rule'), more="")
    assert [state.tick for state in states(spec)][-1] == spec.ticks - 1 == 319


def test_velocities_are_those_of_the_positions(draw: Draw) -> None:
    before, errors = None, []
    for state in states(draw()):
        rows = state.actors
        if before is not None:
            for axis in "xy":
                moved = (rows[axis] - before[axis]) / 0.05
                mean = (rows[f"v{axis}"] + before[f"v{axis}"]) / 2.0
                errors += np.abs(moved - mean).tolist()
        before = rows
    assert np.max(errors) < 0.35  # where the lane change begins, the yaw rate jumps
    assert np.mean(errors) < 0.01


def test_the_first_agent_stands_where_it_begins_its_way_before_tick_0(draw: Draw) -> None:
    spec, found = draw(), []
    with Simulation(spec, load_network(spec.map)) as simulation:
        while (state := simulation.step()).tick < 0:
            found.append((state.tick, float(state.ego["x"])))
    zero_m = float(state.ego["x"])
    assert found[-1] == (-1, pytest.approx(zero_m - 0.6))  # 12 m/s
    assert found[0] == (-20, pytest.approx(zero_m - 12.0, abs=0.3))  # around the corner behind the start


def test_an_agent_driven_from_outside_is_not_moved_by_the_storyboard(
    draw: Draw, caplog: pytest.LogCaptureFixture
) -> None:
    def steer(simulation: Simulation, tick: int) -> None:
        simulation.drive_vehicle(0, 5.0, 0.0)

    *_, last = states(draw(more="ego: {driver: twist}\n"), seconds=6.5, act=steer)
    assert float(last.ego["vx"]) == pytest.approx(5.0, abs=0.1)  # the event Stop has no effect
    assert len(last.actors) == 2
    assert caplog.text.count("Ego is driven from outside") == 1


def test_traffic_is_there_if_the_configuration_asks_for_it(draw: Draw) -> None:
    spec = draw(more="traffic: {vehicles: 3, pedestrians: 2}\n")
    assert len(spec.vehicles) == 4 and len(spec.pedestrians) == 2


GOAL = '<RoutingAction><AcquirePositionAction><Position><LanePosition roadId="245" laneId="-1" s="50"/></Position>'
GOAL += "</AcquirePositionAction></RoutingAction>"


def test_a_stack_is_judged_on_the_route_of_the_scenario(draw: Draw, caplog: pytest.LogCaptureFixture) -> None:
    driven = "ego: {driver: twist}\ndrive: {}\n"
    spec = draw(private("Ego", GOAL), more=driven)
    assert spec.drive is not None
    goal_m = spec.drive.route.points_m[-1]
    np.testing.assert_allclose(goal_m[:2], [-93.125 + 50.0, -119.78], atol=0.1)  # of road 245
    assert draw(more=driven).drive is None
    assert "assigns no route" in caplog.text
    assert draw(private("Ego", GOAL), more="drive: {}\n").drive is None


def private(name: str, *actions: str) -> tuple[str, str]:
    """A change of the example: actions of an entity in ``Init``."""
    inside = "".join(f"<PrivateAction>{action}</PrivateAction>" for action in actions)
    return INIT_END, f'<Private entityRef="{name}">{inside}</Private>{INIT_END}'


def test_lights_and_visibility(draw: Draw) -> None:
    beam = (
        '<AppearanceAction><LightStateAction><LightType><VehicleLight vehicleLightType="highBeam"/></LightType>'
        '<LightState mode="on"/></LightStateAction></AppearanceAction>'
    )
    hide = '<VisibilityAction graphics="false" sensors="false" traffic="false"/>'
    first = next(
        states(
            draw(
                private("Ego", beam),
            )
        )
    )
    assert first.ego["lights"] & Light.HIGH_BEAM
    first = next(states(draw(private("Van", hide))))
    assert list(first.actors["id"]) == [EGO_ID]


def test_weather_of_init_is_that_of_the_scene(draw: Draw) -> None:
    environment = (
        '<GlobalAction><EnvironmentAction><Environment name="e"><Weather fractionalCloudCover="sixOktas">'
        '<Sun azimuth="0" elevation="0.5"/><Fog visualRange="94"/></Weather></Environment></EnvironmentAction>'
        "</GlobalAction>"
    )
    spec = draw(("<Init>\n      <Actions>", f"<Init>\n      <Actions>{environment}"))
    first = next(states(spec))
    assert first.weather == spec.weather
    assert first.weather.cloudiness == 75.0
    assert first.weather.sun_altitude_deg == pytest.approx(np.degrees(0.5))
    assert first.weather.fog_density == pytest.approx(100.0, abs=1.0)


def test_signals_show_what_the_storyboard_says(draw: Draw) -> None:
    network = load_network(maps_of(load_scenario(EXAMPLE))[0])
    row, name = next((row, head.opendrive_id) for row, head in enumerate(network.signals) if head.opendrive_id)
    controller = (
        '<RoadNetwork><LogicFile filepath="Blocks"/><TrafficSignals><TrafficSignalController name="c">'
        f'<Phase name="go" duration="1"><TrafficSignalState trafficSignalId="{name}" state="green"/></Phase>'
        f'<Phase name="no" duration="2"><TrafficSignalState trafficSignalId="{name}" state="on;off;off"/></Phase>'
        "</TrafficSignalController></TrafficSignals></RoadNetwork>"
    )
    spec = draw(('<RoadNetwork><LogicFile filepath="Blocks"/></RoadNetwork>', controller))
    shown = [SignalState(int(state.signals["state"][row])) for state in states(spec, seconds=4.0)]
    assert shown[:20] == [SignalState.GREEN] * 20
    assert shown[20:60] == [SignalState.RED] * 40
    assert shown[60] == SignalState.GREEN


TELEPORT = '<LanePosition roadId="244" laneId="-1" s="10"/>'
VAN = '<RelativeLanePosition entityRef="Ego" dLane="-1" ds="$lead"/>'
GONE = '<LanePosition roadId="9" laneId="-1" s="1"/>'
BRAKE = EXAMPLE.read_text().split('<Action name="Brake">')[1].split("<PrivateAction>")[1].split("</PrivateAction>")[0]


def test_world_positions_are_those_of_the_file_of_a_map_that_is_far_from_its_origin(tmp_path: Path) -> None:
    road = straight(tmp_path).read_text().replace('x="0" y="0"', 'x="691000" y="5335000"')
    (tmp_path / "far.xodr").write_text(road)
    scenario = EXAMPLE.read_text().replace('"Blocks"', '"far.xodr"').replace(VAN, VAN.replace("-1", "0"))
    changed = scenario.replace(TELEPORT, '<WorldPosition x="691100" y="5334998.25"/>')
    (tmp_path / "scenario.xosc").write_text(changed)
    (tmp_path / "my.yaml").write_text(f"scenarios: [scenario.xosc]\ntime: {{warm_up_s: 1}}\n{RIG}")
    config = load_scenario(tmp_path / "my.yaml")
    (planned,) = planned_scenes(config)
    network = load_network(planned.map)
    assert network.origin_m == (691000.0, 5335000.0, 0.0)
    first = next(states(draw_scene(config, planned, network)))
    np.testing.assert_allclose(first.actors["x"], [100.0 + 1.4, 116.0 + 1.8], atol=0.01)
    np.testing.assert_allclose(first.actors["y"], -1.75, atol=0.01)


def test_entities_may_be_relative_to_those_that_come_later(draw: Draw) -> None:
    usual = next(states(draw()))
    spec = draw(
        (TELEPORT, '<RelativeLanePosition entityRef="Van" dLane="1" ds="-16"/>'),
        (VAN, '<LanePosition roadId="244" laneId="-2" s="26"/>'),
    )
    np.testing.assert_allclose(next(states(spec)).actors["x"], usual.actors["x"], atol=0.01)


def test_what_does_not_exist_at_its_time_is_noted_once(draw: Draw, caplog: pytest.LogCaptureFixture) -> None:
    near = '<RelativeSpeedCondition entityRef="Van" value="1" rule="greaterThan"/>'
    beside = '<RelativeLanePosition entityRef="Van" dLane="-9" ds="0"/>'
    reached = f'<ReachPositionCondition tolerance="1"><Position>{beside}</Position></ReachPositionCondition>'
    spec = draw(('<AbsoluteTargetLane value="-1"/>', '<AbsoluteTargetLane value="-9"/>'), (near, reached))
    *_, last = states(spec, seconds=3.0)
    assert len(last.actors) == 2
    assert caplog.text.count("LaneChangeAction of Van has no effect: road 244 has no lane -9") == 1
    assert caplog.text.count("; the condition does not hold") == 1


def test_the_log_says_what_is_done_in_another_way(draw: Draw, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level("INFO"):
        draw(
            ('dynamicsShape="linear"', 'followingMode="follow" dynamicsShape="linear"'),
            (
                '<SimulationTimeCondition value="1" rule="greaterOrEqual"/>',
                '<UserDefinedValueCondition name="u" value="1" rule="equalTo"/>',
            ),
            (INIT_END, f"{SIGNAL}{INIT_END}"),
            (TELEPORT, '<WorldPosition x="-206.7" y="-100"/>'),
            (VAN, '<WorldPosition x="-206.7" y="-90"/>'),
            more="ego: {driver: twist}\n",
        )
    for words in (
        "<TransitionDynamics followingMode='follow'>: it is followed exactly",
        "<UserDefinedValueCondition name='u'>: it never holds",
        "the map has no signals nowhere",
        "Van is put",
        "Ego is driven from outside (twist): it starts from rest in the middle of the nearest lane",
    ):
        assert caplog.text.count(words) == 1, words


SIGNAL = (
    "<GlobalAction><InfrastructureAction><TrafficSignalAction>"
    '<TrafficSignalStateAction name="nowhere" state="red"/>'
    "</TrafficSignalAction></InfrastructureAction></GlobalAction>"
)


VARIED = """<OpenSCENARIO><FileHeader revMajor="1" revMinor="2" date="2026-01-01T00:00:00" description="" author=""/>
<ParameterValueDistribution><ScenarioFile filepath="base.xosc"/><Deterministic>
<DeterministicSingleParameterDistribution parameterName="speed"><DistributionSet>
<Element value="8"/><Element value="9"/></DistributionSet></DeterministicSingleParameterDistribution>
</Deterministic></ParameterValueDistribution></OpenSCENARIO>
"""


def test_scenes_have_the_values_of_a_distribution_in_turn(tmp_path: Path) -> None:
    (tmp_path / "base.xosc").write_text(EXAMPLE.read_text())
    (tmp_path / "varied.xosc").write_text(VARIED)
    more = "scenes: [{scenario: varied.xosc, test: 3}]\ntraffic: {vehicles: 0}\n"
    (tmp_path / "my.yaml").write_text(more + RIG)
    config = load_scenario(tmp_path / "my.yaml")
    speeds = []
    for planned in planned_scenes(config):
        spec = draw_scene(config, planned, load_network(planned.map))
        speeds.append(float(next(states(spec)).ego["vx"]))
    assert speeds == pytest.approx([8.0, 9.0, 8.0])


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (('filepath="Blocks"', 'filepath=""'), "names no road network"),
        (('filepath="Blocks"', 'filepath="Town99"'), "no map is called 'Town99'"),
        (('roadId="244"', 'roadId="999"'), "there is no road 999"),
        (('laneId="-1"', 'laneId="-7"'), "road 244 has no lane -7"),
        (("AbsoluteTargetLane", "AbsoluteTargetLine"), "AbsoluteTargetLine"),
        (('s="10"', 's="200"'), r":39: LanePosition: s = 200 is not on road 244, whose s goes from 0 to 104\.265"),
        ((TELEPORT, '<WorldPosition x="1e6" y="0"/>'), r":46: RelativeLanePosition: \(1000000.0, 0.0\) is on no road"),
        ((f"<TeleportAction><Position>{TELEPORT}</Position></TeleportAction>", ""), ":46: .*: Ego is not in the scene"),
        ((VAN, '<RelativeObjectPosition entityRef="Van" dx="1" dy="0"/>'), ":46: .*: Van is not in the scene"),
        (
            (
                BRAKE,
                f"<!--{BRAKE}--><RoutingAction><AcquirePositionAction><Position>{GONE}</Position></AcquirePositionAction></RoutingAction>",
            ),
            ":77: LanePosition: there is no road 9",
        ),
    ],
)
def test_what_cannot_be_played_is_an_error(draw: Draw, change: tuple[str, str], problem: str) -> None:
    with pytest.raises(InputError, match=problem):
        draw(change)
