"""The section ``agents``: the short and the long form are one configuration, and errors name the line of the agent."""

import pickle
from pathlib import Path

import pytest
import yaml
from display_topics import display_topics

from simbev_ros.config.agents import RESERVED_NAMES
from simbev_ros.config.annotation import Annotation, Occupancy, VectorMapPatch
from simbev_ros.config.frames import Frames
from simbev_ros.config.load import load_scenario, parse_scenario
from simbev_ros.config.places import Near, SpawnPose
from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.limits import MAX_AGENTS
from simbev_ros.ros.msgs.topics import manifest
from simbev_ros.ros.msgs.typed_topics import typed_topics
from simbev_ros.schema.scene.agent_spec import AgentSpec
from simbev_ros.schema.scene.spec import SceneSpec

SCENES = "scenes: [{map: Blocks, train: 1}]\n"
RIG = "rig: {sensors: [{type: lidar, name: top}, {type: imu, name: imu}]}"
EGO = f"{SCENES}{RIG}\n"
TWO = f"{SCENES}agents:\n  - {{name: ego, {RIG}}}\n"
"""A configuration whose line 4 may be a second agent."""


def entry(text: str) -> str:
    return f"{TWO}  - {{{RIG}, {text}}}"


def mast(text: str, rig: str = RIG) -> str:
    """A configuration whose line 4 is a roadside unit."""
    return f"{TWO}  - {{name: rsu, {rig}, {text}}}"


LIST_OF_ONE = f"""{SCENES}agents:
  - name: first
    {RIG}
    blueprint: vehicle.van
    driver: twist
    spawn: [{{x_m: 1, y_m: 2}}]
    reckless_probability: 0.5
    frames: {{odom: true}}
    annotation: {{box_radius_m: 50}}
"""
SHORT_FORM = f"""{SCENES}rig: {{agent: first, sensors: [{{type: lidar, name: top}}, {{type: imu, name: imu}}]}}
ego: {{blueprint: vehicle.van, driver: twist, spawn: [{{x_m: 1, y_m: 2}}], reckless_probability: 0.5}}
frames: {{odom: true}}
annotation: {{box_radius_m: 50}}
"""


def test_a_list_of_one_agent_is_the_short_form() -> None:
    one, short = parse_scenario(LIST_OF_ONE, "one"), parse_scenario(SHORT_FORM, "short")
    assert one == short
    assert one.as_yaml() == short.as_yaml()


@pytest.mark.parametrize("name", ["demo", "paper", "live"])
def test_a_shipped_configuration_as_a_list_of_one_is_dumped_with_the_same_bytes(name: str, tmp_path: Path) -> None:
    data = yaml.safe_load(load_scenario(name).as_yaml())
    first = {"name": data["rig"]["agent"], "rig": data.pop("rig"), "annotation": data.pop("annotation")}
    path = tmp_path / "list.yaml"
    path.write_text(yaml.safe_dump(data | {"agents": [first | data.pop("ego")]}))
    assert load_scenario(path).as_yaml() == load_scenario(name).as_yaml()


def test_null_is_the_default_in_the_first_entry_as_in_the_others() -> None:
    nulls = "count: null, near: null, frames: null, annotation: null"
    assert parse_scenario(TWO.replace("name: ego", f"name: ego, {nulls}"), "x") == parse_scenario(TWO, "x")
    assert parse_scenario(entry(f"name: car, {nulls}"), "x") == parse_scenario(entry("name: car"), "x")


def test_agents_come_in_addition_to_the_sections_of_the_first_one() -> None:
    scenario = parse_scenario(f"{EGO}agents: [{{name: car, {RIG}}}]", "x")
    assert (scenario.rig.agent, [agent.name for agent in scenario.agents]) == ("ego", ["car"])
    assert scenario == parse_scenario(entry("name: car"), "x")


def test_the_name_replaces_that_of_the_rig(tmp_path: Path) -> None:
    (tmp_path / "rig.yaml").write_text("agent: somebody\nsensors: [{type: imu, name: imu}]")
    path = tmp_path / "x.yaml"
    path.write_text(f"{SCENES}agents: [{{name: a, rig: rig.yaml}}, {{name: b, rig: rig.yaml}}]")
    scenario = load_scenario(path)
    assert (scenario.rig.agent, scenario.agents[0].rig.agent) == ("a", "b")


def test_a_dump_reads_back_as_itself() -> None:
    scenario = parse_scenario(
        entry("name: car, count: {integer: [0, 3]}, near: {distance_m: {uniform: [20, 60]}}, frames: {odom: true}"), "x"
    )
    assert parse_scenario(scenario.as_yaml(), "dump") == scenario
    assert Scenario.model_validate(scenario.model_dump()) == scenario


@pytest.mark.parametrize("arrangement", ["cluster", "chain", "{choice: [chain]}", "{choice: [cluster, chain]}"])
def test_arrangements_read_back_as_themselves_and_have_a_distance(arrangement: str) -> None:
    scenario = parse_scenario(entry(f"name: car, count: 3, arrangement: {arrangement}"), "x")
    (cars,) = scenario.agents
    assert (cars.near, cars.starts_near, cars.may_chain) == (None, Near(), arrangement != "cluster")
    assert parse_scenario(scenario.as_yaml(), "dump") == scenario


def test_a_configuration_without_arrangement_is_dumped_without_it() -> None:
    assert "arrangement" not in parse_scenario(entry("name: car, count: 3"), "x").as_yaml()


def test_start_poses_by_map_read_back_as_themselves() -> None:
    scenario = parse_scenario(entry("name: car, color: 0xFF8000, spawn: {Blocks: [{x_m: 1, y_m: 2}]}"), "x")
    (car,) = scenario.agents
    pose = SpawnPose(x_m=1, y_m=2)
    assert (car.color, car.spawn_on("Blocks")) == (0xFF8000, (("spawn", "Blocks"), (pose,)))
    assert car.spawn_on("Town01") == (("spawn", "Town01"), ())
    assert parse_scenario(scenario.as_yaml(), "dump") == scenario


def test_agents_are_counted_from_one_and_one_without_count_has_the_plain_name() -> None:
    scenario = parse_scenario(f"{entry('name: car, count: {integer: [1, 3]}')}\n  - {{name: van, {RIG}}}", "x")
    cars, van = scenario.agents
    assert (cars.min_count, cars.max_count, cars.names(2)) == (1, 3, ("car_1", "car_2"))
    assert (van.min_count, van.max_count, van.names(1)) == (1, 1, ("van",))


ALL_SENSORS = """rig: {sensors: [
  {type: camera, name: cam, modalities: [rgb, semantic]}, {type: lidar, name: lidar, semantic_points: true},
  {type: radar, name: radar}, {type: gnss, name: gnss}, {type: imu, name: imu, pose: {z_m: 50}}]}"""


def test_a_mast_carries_all_sensors_but_odometry_and_reads_back_without_fields_of_vehicles() -> None:
    scenario = parse_scenario(mast("mast: {junction: {signalised: true}, height_m: 150}, count: 2", ALL_SENSORS), "x")
    dump = yaml.safe_load(scenario.as_yaml())["agents"][0]
    assert dump.keys() == {"name", "rig", "count", "mast", "frames", "annotation", "v2x", "evaluation"}
    assert parse_scenario(scenario.as_yaml(), "dump") == scenario
    nulls = "count: null, near: null, spawn: [], frames: {odom: false}, mast: {above_road: {near: null}}"
    assert parse_scenario(mast(nulls), "x").agents[0].frames == Frames(odom=False)


def test_a_roadside_unit_takes_part_in_messages_unless_it_says_otherwise() -> None:
    car = f"\n  - {{name: car, {RIG}}}\nv2x: {{}}"
    for field, agents in (("v2x: true", ("ego", "rsu", "car")), ("v2x: false", ("ego", "car"))):
        scenario = parse_scenario(mast(f"mast: {{junction: {{}}}}, {field}") + car, "x")
        assert scenario.v2x_agents == agents
        assert parse_scenario(scenario.as_yaml(), "dump") == scenario


def test_the_first_vehicle_of_a_list_is_the_first_agent() -> None:
    unit = f"  - {{name: rsu, {RIG}, mast: {{junction: {{}}}}, count: 2}}\n"
    before, after = f"{SCENES}agents:\n{unit}{TWO.splitlines()[-1]}\n", f"{TWO}{unit}"
    scenario = parse_scenario(before, "my.yaml")
    assert scenario == parse_scenario(after, "x") and [rig.agent for rig in scenario.rigs] == ["ego", "rsu_1", "rsu_2"]
    assert scenario.where("ego", "blueprint") == "my.yaml:4: agents[1].blueprint"
    assert scenario.where("agents", 0, "mast", "junction") == "my.yaml:3: agents[0].mast.junction"


def test_fields_are_found_in_the_file_again_also_in_copies() -> None:
    text = f"{TWO}  - name: car\n    {RIG}\n    spawn:\n      - {{x_m: 1, y_m: 2}}\n      - {{x_m: 3, y_m: 4}}\n"
    scenario = parse_scenario(text, "my.yaml")
    for each in (scenario, scenario.model_copy(update={"seed": 5}), pickle.loads(pickle.dumps(scenario))):
        assert each.where("agents", 0, "spawn", 1) == "my.yaml:8: agents[1].spawn[1]"
        assert each.where("agents", 0, "near") == "my.yaml:4: agents[1].near"
        assert each.where("ego", "blueprint") == "my.yaml:3: agents[0].blueprint"
    assert Scenario.model_validate(scenario.model_dump()).where("agents", 0, "spawn", 1) == "agents[0].spawn[1]"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (entry("name: ego"), r"x.yaml:4: agents\[1\].name: two agents are called ego; names must be unique"),
        (
            f"{entry('name: car, count: {integer: [0, 2]}')}\n  - {{name: car_2, {RIG}}}",
            r"x.yaml:5: agents\[2\].name: two agents are called car_2",
        ),
        (f"{EGO}agents:\n - {{name: ego, {RIG}}}", r"x.yaml:4: agents\[0\].name: two agents are called ego"),
        (
            entry("name: world"),
            r"x.yaml:4: agents\[1\].name: 'world' is taken; not allowed: all, world, sync, .*, odom",
        ),
        (entry("name: car").replace("ego", "tf"), r"x.yaml:3: agents\[0\].name: 'tf' is taken"),
        (entry("name: top"), r"x.yaml:4: agents\[1\].name: a sensor is called top, too"),
        (entry("name: Car"), r"x.yaml:4: agents\[1\].name: .*pattern .* not 'Car'"),
        (entry("name: car").replace("ego", "Ego"), r"x.yaml:3: agents\[0\].name: .*pattern .* not 'Ego'"),
        (entry(f"name: {'c' * 39}, count: 2"), r"x.yaml:4: agents\[1\].name: c*_1 is longer than the allowed 40"),
        (entry("blueprint: vehicle.van"), r"x.yaml:4: agents\[1\].name: is missing"),
        (f"{SCENES}agents:\n - {{{RIG}}}", r"x.yaml:3: agents\[0\].name: is missing"),
        (f"{SCENES}agents:\n - {{name: ego}}", r"x.yaml:3: agents\[0\].rig: is missing"),
        (f"{TWO}  - {{name: car}}", r"x.yaml:4: agents\[1\].rig: is missing"),
        (f"{SCENES}agents: []", "x.yaml:1: rig: is missing"),
        (entry("name: car, count: 32"), r"x.yaml:3: agents: up to 33 agents in a scene; at most 32 are allowed"),
        (entry("name: car, count: 40"), r"x.yaml:4: agents\[1\].count: is 40, but 0 to 32 is allowed"),
        (
            entry("name: car, count: {integer: [0, 99]}"),
            r"x.yaml:4: agents\[1\].count: draws from 0 to 99, but 0 to 32",
        ),
        (entry("name: car, count: two"), r"x.yaml:4: agents\[1\].count: .*valid number.*'two'"),
        (
            entry("name: car").replace("name: ego", "name: ego, count: 2"),
            r"x.yaml:3: agents\[0\].count: only agents after the first one can have it",
        ),
        (
            entry("name: car").replace("name: ego", "name: ego, near: {}"),
            r"x.yaml:3: agents\[0\].near: only agents after",
        ),
        (
            entry("name: car").replace("name: ego", "name: ego, carrier: 3"),
            r"x.yaml:3: agents\[0\].carrier: only agents after the first one can have it",
        ),
        (entry("name: car, near: {agent: van}"), r"x.yaml:4: agents\[1\].near.agent: no agent 'van' .*; allowed: ego$"),
        (
            f"{entry('name: car, count: {integer: [1, 3]}')}\n  - {{name: van, {RIG}, near: {{agent: car_2}}}}",
            r"x.yaml:5: agents\[2\].near.agent: no agent 'car_2' is listed .* in every scene; allowed: ego, car_1$",
        ),
        (
            entry("name: car, arrangement: chain"),
            r"x.yaml:4: agents\[1\].arrangement: leave it out; an entry without count is one agent",
        ),
        (
            entry("name: car, count: 1, arrangement: chain, spawn: [{x_m: 1, y_m: 2}]"),
            r"x.yaml:4: agents\[1\].arrangement: leave it out; spawn says where each agent starts",
        ),
        (
            entry("name: car, count: 2, arrangement: line"),
            r"x.yaml:4: agents\[1\].arrangement: 'line' is not known; allowed: 'cluster' or 'chain'",
        ),
        (
            entry("name: car, count: 2, arrangement: {choice: [line]}"),
            r"x.yaml:4: agents\[1\].arrangement.choice\[0\]: 'line' is not known; allowed: 'cluster' or 'chain'",
        ),
        (
            entry("name: car").replace("name: ego", "name: ego, arrangement: chain"),
            r"x.yaml:3: agents\[0\].arrangement: only agents after",
        ),
        (
            f"{mast('mast: {above_road: {}}')}\n"
            f"  - {{name: car, {RIG}, count: 2, arrangement: {{choice: [chain]}}, near: {{agent: rsu}}}}",
            r"x.yaml:5: agents\[2\].near.agent: rsu is a roadside unit; a chain needs a vehicle",
        ),
        (entry("name: car, near: {distance_m: 2}"), r"x.yaml:4: agents\[1\].near.distance_m: is 2, but 5 to 1000"),
        (entry("name: car, near: {tolerance_m: 0}"), r"x.yaml:4: agents\[1\].near.tolerance_m: .* 0, not 0"),
        (
            entry("name: car, near: {}, spawn: [{x_m: 1, y_m: 2}]"),
            r"x.yaml:4: agents\[1\].near: spawn and near are set; give one of them",
        ),
        (
            entry("name: car, nearby: {}"),
            r"x.yaml:4: agents\[1\].nearby: unknown key; did you mean near\? allowed: .*count",
        ),
        (
            entry("name: car").replace("name: ego", "name: ego, spawm: []"),
            r"x.yaml:3: agents\[0\].spawm: unknown key; did you mean spawn\? allowed: .*name, rig",
        ),
        (entry("name: car, spawn: [{x: 1}]"), r"x.yaml:4: agents\[1\].spawn\[0\].x: unknown key; did you mean x_m\?"),
        (
            entry("name: car, spawn: {Blocks: [{x: 1}]}"),
            r"x.yaml:4: agents\[1\].spawn.Blocks\[0\].x: unknown key; did you mean x_m\?",
        ),
        (
            entry("name: car, spawn: {Town1: [{x_m: 1, y_m: 2}]}"),
            r"x.yaml:4: agents\[1\].spawn.Town1: no scene is on a map of this name; allowed: Blocks$",
        ),
        (entry("name: car, color: 0x1000000"), r"x.yaml:4: agents\[1\].color: .*equal to 16777215, not 16777216"),
        (
            entry("name: car").replace("type: imu, name: imu", "type: imu, name: imu, rate: 3"),
            r"x.yaml:3: agents\[0\].rig.sensors\[1\].rate: unknown key; did you mean rate_hz\?",
        ),
        (
            f"{TWO}  - name: car\n    rig:\n      sensors:\n        - {{type: gnss, name: g, rate_hz: 7}}",
            r"x.yaml:7: agents\[1\].rig.sensors\[0\]: sensor g: rate_hz 7 does not divide the tick rate 20 Hz",
        ),
        (
            f"{TWO}  - name: car\n    {RIG}\n    annotation: {{occupancy: {{rate_hz: 3}}}}",
            r"x.yaml:6: agents\[1\].annotation.occupancy: rate_hz 3 does not divide the tick rate 20 Hz",
        ),
        (f"{TWO}ego: {{driver: twist}}", r"x.yaml:4: ego: leave it out; agents\[0\] describes the first agent"),
        (
            f"{TWO.replace('ego,', 'ego, frames: {odom: true},')}frames: {{odom: true}}",
            r"x.yaml:4: frames: leave it out; agents\[0\] describes the first agent",
        ),
        (f"{TWO}annotation: {{box_radius_m: 0}}", r"x.yaml:4: annotation.box_radius_m: .* greater than 0, not 0"),
        (f"{TWO}  - {{name: car, rig: none.yaml}}", r"x.yaml:4: agents\[1\].rig: no such file: .*none.yaml"),
        (f"{TWO}  - {{name: car, rig: none.txt}}", r"x.yaml:4: agents\[1\].rig: must be a file that ends in .yaml or"),
        (f"{SCENES}\nrig: none.yaml", "x.yaml:3: rig: no such file: .*none.yaml"),
        (
            f"{TWO}  - {{name: car, rig: {{defaults: {{camera: {{}}}}, sensors: []}}}}",
            r"x.yaml:4: agents\[1\].rig.defaults: no sensor of type camera is in the rig",
        ),
        (mast("mast: {}"), r"x.yaml:4: agents\[1\].mast: needs exactly one of poses, junction, above_road; found none"),
        (
            mast("mast: {poses: [{x_m: 1, y_m: 2}], junction: {}}"),
            r"x.yaml:4: agents\[1\].mast: needs exactly one of .*; found poses and junction",
        ),
        (
            mast("mast: {above_road: {}, height_m: 151}"),
            r"x.yaml:4: agents\[1\].mast.height_m: .*or equal to 150, not 151",
        ),
        (
            mast("mast: {above_road: {}, height_m: 150}", "rig: {sensors: [{type: imu, name: i, pose: {z_m: 51}}]}"),
            r"x.yaml:4: agents\[1\].mast.height_m: with it, sensor i is 201 m above the foot; at most 200 m is allowed",
        ),
        (
            mast("mast: {above_road: {}}", "rig: {sensors: [{type: imu, name: i, pose: {z_m: 201}}]}"),
            r"x.yaml:4: agents\[1\].rig.sensors\[0\].pose.z_m: .*less than or equal to 200, not 201",
        ),
        *(
            (
                mast(f"mast: {{junction: {{}}}}, {field}"),
                rf"x.yaml:4: agents\[1\].{field.split(':')[0]}: leave it out; an agent with a mast is a roadside unit",
            )
            for field in (
                *("blueprint: vehicle.van", "driver: traffic", "reckless_probability: 0.1"),
                *("near: {}", "spawn: [{x_m: 1, y_m: 2}]", "arrangement: chain, count: 2"),
            )
        ),
        (
            mast("mast: {junction: {}}, frames: {odom: true}"),
            r"x.yaml:4: agents\[1\].frames.odom: a roadside unit has no odometry",
        ),
        (
            mast("mast: {junction: {}}, frames: {base_link: rear_axle}"),
            r"x.yaml:4: agents\[1\].frames.base_link: a roadside unit has no axles; allowed: footprint",
        ),
        (
            mast("mast: {junction: {}}", "rig: {sensors: [{type: odometry, name: wheel}]}"),
            r"x.yaml:4: agents\[1\].rig.sensors\[0\]: sensor wheel: a roadside unit has no wheels",
        ),
        (
            mast("mast: {junction: {near: {agent: van}}}"),
            r"x.yaml:4: agents\[1\].mast.junction.near.agent: no agent 'van' is listed .*; allowed: ego$",
        ),
        (
            mast("mast: {poses: {Town01: [{x_m: 1, y_m: 2}]}}"),
            r"x.yaml:4: agents\[1\].mast.poses.Town01: no scene is on a map of this name; allowed: Blocks$",
        ),
        (
            mast("mast: {poses: {Blocks: [{x_m: 1, y_m: 2}]}}").replace(
                "train: 1}", "train: 1}, {map: Town01, val: 1}"
            ),
            r"x.yaml:4: agents\[1\].mast.poses: has no poses on Town01, where scenes are, too$",
        ),
        (
            mast("mast: {poses: {Blocks: [{x_m: 1, y_m: 2}]}}, count: 2"),
            r"x.yaml:4: agents\[1\].mast.poses.Blocks: up to 2 roadside units need a pose each; found 1",
        ),
        (
            mast("mast: {poses: [{x_m: 1, y_m: 2}]}, count: {integer: [0, 2]}"),
            r"x.yaml:4: agents\[1\].mast.poses: up to 2 roadside units need a pose each; found 1",
        ),
        (
            f"{SCENES}agents:\n  - {{name: rsu, {RIG}, mast: {{junction: {{}}}}}}",
            r"x.yaml:3: agents: all agents have a mast; at least one must be a vehicle",
        ),
        (
            mast("mast: {junktion: {}}"),
            r"x.yaml:4: agents\[1\].mast.junktion: unknown key; did you mean junction\? allowed: poses, .*, height_m",
        ),
        (
            f"{SCENES}rig: {{sensors: [{{type: imu, name: i, pose: {{z_m: 30}}}}]}}",
            r"x.yaml:2: rig.sensors\[0\].pose.z_m: is 30, but at most 20 is allowed on a vehicle",
        ),
        (
            entry("name: car")
            .replace("{type: imu, name: imu}", "{type: imu, name: imu, pose: {z_m: 30}}")
            .replace("{type: imu, name: imu, pose: {z_m: 30}}", "{type: imu, name: imu}", 1),
            r"x.yaml:4: agents\[1\].rig.sensors\[1\].pose.z_m: is 30, but at most 20 is allowed on a vehicle",
        ),
        (f"{EGO}agents: [car]", r"x.yaml:3: agents\[0\]: .*Agent, not 'car'"),
    ],
)
def test_an_error_names_the_file_the_line_and_the_field(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "x.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        load_scenario(path)


@pytest.mark.parametrize("agent", ["ego", "car"])
def test_an_error_in_an_agents_rig_file_names_that_file_and_its_line(tmp_path: Path, agent: str) -> None:
    (tmp_path / "good.yaml").write_text("sensors: []")
    (tmp_path / "bad.yaml").write_text("sensors:\n  - type: lidar\n    name: top\n    channels: 0\n")
    rigs = {"ego": "good.yaml", "car": "good.yaml", agent: "bad.yaml"}
    path = tmp_path / "x.yaml"
    path.write_text(
        SCENES + "agents: [" + ", ".join(f"{{name: {name}, rig: {rig}}}" for name, rig in rigs.items()) + "]"
    )
    with pytest.raises(InputError, match=r"bad.yaml:4: sensors\[0\].channels: .*greater than or equal to 1, not 0"):
        load_scenario(path)


def test_the_name_of_the_only_agent_is_free() -> None:
    assert parse_scenario(EGO.replace("{sensors", "{agent: top, sensors"), "x").rig.agent == "top"


def test_as_many_agents_as_there_are_bits_are_allowed() -> None:
    scenario = parse_scenario(entry(f"name: car, count: {MAX_AGENTS - 1}"), "x")
    assert len(scenario.agents[0].names(scenario.agents[0].max_count)) == MAX_AGENTS - 1


def test_first_parts_of_topics_and_labels_are_reserved() -> None:
    scenario = load_scenario("paper")
    labels = Annotation(occupancy=Occupancy(), vector_map=VectorMapPatch())
    agent = AgentSpec(rig=scenario.rig, frames=Frames(odom=True), annotation=labels, vehicle=0)
    values = {"agents": (agent,), "tick_ns": scenario.time.tick_ns}
    spec: SceneSpec = SceneSpec.model_construct(**values)  # type: ignore[arg-type]  # topics need no more of a scene
    topics = [
        *manifest(spec, compressed_images=True),
        *display_topics(spec),
        *(each.topic for each in typed_topics(spec)),
    ]
    parts = [topic.name.split("/")[1:] for topic in topics]
    own = {second for first, second, *_ in (part for part in parts if part[0] == "ego")}
    assert {part[0] for part in parts} - {"ego"} <= set(RESERVED_NAMES)
    assert own - {sensor.name for sensor in scenario.rig.sensors} <= set(RESERVED_NAMES)
