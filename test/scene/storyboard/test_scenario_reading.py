"""Scenarios are resolved: parameters, catalogs, deprecated forms; whatever is wrong is named with its line."""

import math
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest
from hand_written_scenario import CATALOG, SCENARIO, line_with, write_hand_written_scenario

from simbev_ros.foundation.errors import InputError
from simbev_ros.scene.storyboard import model, resolving
from simbev_ros.scene.storyboard.model import elements_in
from simbev_ros.scene.storyboard.reading import read_resolved, resolve

LANE_CHANGE = "LaneChangeAction"
POSITION = '<LanePosition roadId="1" laneId="-1" s="50"/>'
TIME = '<SimulationTimeCondition value="${1 + $runs}" rule="greaterThan"/>'


def read(folder: Path, edits: dict[str, str] | None = None, **values: Any) -> Any:
    return resolve(write_hand_written_scenario(folder, edits), values).scenario


def problems(folder: Path, edits: dict[str, str], **values: Any) -> list[str]:
    with pytest.raises(InputError) as error:
        read(folder, edits, **values)
    return [line.removeprefix(f"{folder}/") for line in str(error.value).splitlines()]


def first_event(scenario: Any) -> Any:
    return scenario.storyboard.stories[0].acts[0].maneuver_groups[0].maneuvers[0].events[0]


def test_deprecated_forms_have_their_present_meaning(tmp_path: Path) -> None:
    event = first_event(read(tmp_path))
    assert event.priority == "override"
    near, far = (condition.test for condition in event.start_trigger.groups[0].conditions)
    assert (near.coordinate_system, near.relative_distance_type) == ("road", "longitudinal")
    assert far.relative_distance_type == "euclidianDistance"


def test_entities_of_a_catalog_have_the_assigned_parameters(tmp_path: Path) -> None:
    ego, other = read(tmp_path).entities
    assert (ego.body.performance.max_speed_mps, other.body.performance.max_speed_mps) == (13.5, 60)
    assert ego.body.bounding_box.dimensions == model.Dimensions(length_m=4.5, width_m=1.8, height_m=1.5)


def test_given_values_replace_declared_ones(tmp_path: Path) -> None:
    scenario = read(tmp_path, speed=20, runs=3.6)
    assert scenario.entities[0].body.performance.max_speed_mps == 20
    assert scenario.storyboard.stories[0].acts[0].maneuver_groups[0].maximum_execution_count == 4
    assert scenario.parameters[0] == model.ParameterDeclaration(name="speed", parameter_type="double", value="20")


def test_a_group_of_maneuvers_runs_once_where_no_count_is_given(tmp_path: Path) -> None:
    scenario = read(tmp_path, {' maximumExecutionCount="$runs"': ""})
    assert scenario.storyboard.stories[0].acts[0].maneuver_groups[0].maximum_execution_count == 1


def test_a_relative_position_may_leave_out_its_distances() -> None:
    read_defaults = {
        name: {spec.name: spec.default for spec in fields(getattr(model, name))}
        for name in ("RelativeObjectPosition", "RelativeLanePosition")
    }
    assert read_defaults["RelativeObjectPosition"]["dx_m"] == read_defaults["RelativeObjectPosition"]["dy_m"] == 0
    assert read_defaults["RelativeLanePosition"]["d_lane"] == 0


@pytest.mark.parametrize(
    ("rest", "value", "dimension"),
    [("", 0, "time"), (' value="3"', 3, "time"), (' value="3" dynamicsDimension="rate"', 3, "rate")],
)
def test_a_step_needs_neither_dimension_nor_value(rest: str, value: float, dimension: str, tmp_path: Path) -> None:
    whole = 'dynamicsShape="cubic" value="3" dynamicsDimension="time"'
    scenario = read(tmp_path, {whole: f'dynamicsShape="step"{rest}'})
    (change,) = [each for each in elements_in(scenario) if each.kind == LANE_CHANGE]
    dynamics = change.dynamics
    assert (dynamics.dynamics_shape, dynamics.value, dynamics.dynamics_dimension) == ("step", value, dimension)


def test_other_shapes_need_both(tmp_path: Path) -> None:
    (problem,) = problems(tmp_path, {' value="3" dynamicsDimension="time"': ' value="3"'})
    assert "dynamicsDimension" in problem


def test_an_expression_is_replaced_by_its_value(tmp_path: Path) -> None:
    trigger = read(tmp_path).storyboard.stories[0].acts[0].start_trigger
    assert trigger.groups[0].conditions[0].test == model.SimulationTimeCondition(value_s=3.0, rule="greaterThan")


def test_a_selection_of_entities_is_replaced_by_its_members(tmp_path: Path) -> None:
    scenario = read(tmp_path)
    both = (model.EntityRef(entity_ref="ego"), model.EntityRef(entity_ref="other"))
    assert scenario.storyboard.stories[0].acts[0].maneuver_groups[0].actors.entities == both
    assert first_event(scenario).start_trigger.groups[0].conditions[0].triggering_entities.entities == both
    assert [private.entity_ref for private in scenario.storyboard.init.privates] == ["ego", "ego", "other"]


def test_an_action_that_overrides_nothing_is_left_out(tmp_path: Path) -> None:
    actions = read(tmp_path).storyboard.init.privates[0].actions
    assert [action.kind for action in actions] == ["AssignControllerAction"]


def test_elements_know_their_lines_also_in_catalogs(tmp_path: Path) -> None:
    scenario = read(tmp_path)
    assert first_event(scenario).origin == f"{tmp_path}/scenario.xosc:{line_with('<Event')}"
    assert scenario.entities[0].body.origin == f"{tmp_path}/catalogs/cars.xosc:5"


def test_angles_of_geographic_positions_are_degrees(tmp_path: Path) -> None:
    place = read(tmp_path, {POSITION: '<GeoPosition latitude="0.5" longitude="-0.25" height="3"/>'})
    position = place.storyboard.init.privates[1].actions[0].position
    assert (position.latitude_deg, position.longitude_deg) == pytest.approx((math.degrees(0.5), math.degrees(-0.25)))


def test_a_light_and_its_state_are_read(tmp_path: Path) -> None:
    light = '<LightType><VehicleLight vehicleLightType="brakeLights"/></LightType><LightState mode="flashing"/>'
    edits = {
        "<TeleportAction>": f"<AppearanceAction><LightStateAction>{light}</LightStateAction></AppearanceAction><!--"
    }
    edits["</TeleportAction>"] = "-->"
    action = read(tmp_path, edits).storyboard.init.privates[1].actions[0]
    assert (action.light.vehicle_light_type, action.state.mode) == ("brakeLights", "flashing")


def test_the_document_does_not_depend_on_the_folder(tmp_path: Path) -> None:
    documents = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        documents.append(resolve(write_hand_written_scenario(tmp_path / name)).document)
    assert documents[0] == documents[1]
    assert "$" not in documents[0]
    assert read_resolved(documents[0]) == read(tmp_path)


def test_a_map_file_is_found_next_to_the_scenario_and_a_bare_name_is_kept(tmp_path: Path) -> None:
    assert resolve(write_hand_written_scenario(tmp_path)).map_name == "Town01"
    (tmp_path / "town.xodr").touch()
    edits = {'filepath="Town01"': f'filepath="../{tmp_path.name}/town.xodr"'}
    assert resolve(write_hand_written_scenario(tmp_path, edits)).map_name == str(tmp_path / "town.xodr")
    assert resolve(write_hand_written_scenario(tmp_path, {'<LogicFile filepath="Town01"/>': ""})).map_name is None


def test_all_problems_are_named_at_once_in_their_order(tmp_path: Path) -> None:
    edits = {
        'value="3" dynamicsDimension': 'value="x" dynamicsDimension',
        'entityRef="other" value="2"': "",
        "$owner": "$own",
    }
    assert [problem.split()[:2] for problem in problems(tmp_path, edits)] == [
        [f"scenario.xosc:{line_with('$owner')}:", "Private.entityRef"],
        [f"scenario.xosc:{line_with('ActionDynamics ')}:", "LaneChangeActionDynamics.value"],
        [f"scenario.xosc:{line_with('TimeHeadway')}:", "TimeHeadwayCondition.entityRef"],
        [f"scenario.xosc:{line_with('TimeHeadway')}:", "TimeHeadwayCondition.value"],
    ]


ACTION = SCENARIO[
    SCENARIO.index("<PrivateAction><LateralAction>") : SCENARIO.index("</Action>\n              <StartTrigger>")
]
DISTANCE = '<LongitudinalDistanceAction entityRef="ego" freespace="true" continuous="false"/>'
VERTEX = '<Vertex time="{}"><Position><WorldPosition x="1" y="2"/></Position></Vertex>'
KNOTS = "".join(f'<Knot value="{value}"/>' for value in (0, 1, 0, 1))
NURBS = '<ControlPoint><Position><WorldPosition x="1" y="2"/></Position></ControlPoint>' * 2
NURBS = f'<Nurbs order="2">{NURBS}{KNOTS}</Nurbs>'


def global_action(parameter: str, change: str) -> str:
    return f'<GlobalAction><ParameterAction parameterRef="{parameter}">{change}</ParameterAction></GlobalAction>'


def follow(shape: str) -> str:
    trajectory = f'<Trajectory name="t" closed="false"><Shape>{shape}</Shape></Trajectory>'
    timing = '<TimeReference><None/></TimeReference><TrajectoryFollowingMode followingMode="position"/>'
    action = f"<FollowTrajectoryAction><TrajectoryRef>{trajectory}</TrajectoryRef>{timing}</FollowTrajectoryAction>"
    return f"<PrivateAction><RoutingAction>{action}</RoutingAction></PrivateAction>"


ERRORS = [
    ({'revMinor="0"': 'revMinor="9"'}, "FileHeader", "the version in <FileHeader> is 1.9; read are 1.0, 1.1, 1.2, 1.3"),
    ({'dynamicsShape="cubic"': 'dynamicsShape="cubik"'}, "cubic", "is 'cubik'; did you mean cubic? allowed: linear,"),
    (
        {'dynamicsShape="cubic"': 'dynamicShape="cubic"'},
        "cubic",
        "dynamicShape is not an attribute that is read; did you mean",
    ),
    ({'name="story"': ""}, 'name="story"', "Story.name is missing"),
    (
        {'delay="0.5"': 'delay="-3"'},
        'delay="0.5"',
        "delay is '-3'; must be a finite number of at least 0 and at most 1e+12",
    ),
    ({'value="3" dyn': 'value="nan" dyn'}, 'value="3" dyn', "value is 'nan'; must be a finite number"),
    (
        {'entityRef="other" value="9"': 'entityRef="othr" value="9"'},
        'value="9"',
        "'othr', which does not exist; did you mean other?",
    ),
    (
        {'entryName="sedan"/>': 'entryName="sedn"/>'},
        '"sedan"/>',
        "no entry of catalog Cars 'sedn'; did you mean sedan?",
    ),
    (
        {'"Cars" entryName="sedan"/>': '"Vans" entryName="sedan"/>'},
        '"sedan"/>',
        "no catalog 'Vans'; did you mean Cars? there are: Cars",
    ),
    (
        {'parameterRef="top"': 'parameterRef="tip"'},
        None,
        "<Vehicle> has no parameter tip; did you mean top? declared: top",
    ),
    ({"$runs}": "$rnus}"}, "$runs}", "uses the parameter rnus, which is not declared; did you mean runs?"),
    ({"1 + $runs": "1 + $owner"}, "$runs}", "has the operand 'ego', which is not a number"),
    ({'"integer" value="2"': '"integer" value="2.5"'}, '"integer"', "parameter runs is '2.5'; must be an integer"),
    (
        {'"integer"': '"whole"'},
        '"integer"',
        "parameter runs has the type 'whole'; did you mean double? allowed: string,",
    ),
    ({'path="catalogs"': 'path="nowhere"'}, "Directory", "cannot read the folder"),
    ({'"Town01"': '"town.xodr"'}, "Town01", "no such file"),
    ({"LateralAction>": "AnimationAction>"}, "<LateralAction>", "<AnimationAction> in <Action> is not supported; "),
    (
        {'active="false"': 'active="true"'},
        "Override",
        "<OverrideControllerValueAction> in <Private> is not supported; ",
    ),
    (
        {TIME: '<ParameterCondition parameterRef="x" value="1" rule="equalTo"/>'},
        "$runs}",
        "'x', which does not exist; there are: speed",
    ),
    (
        {TIME: '<VariableCondition variableRef="x" value="1" rule="equalTo"/>'},
        "$runs}",
        "'x', which does not exist; there are: none",
    ),
    (
        {TIME: '<TrafficSignalControllerCondition trafficSignalControllerRef="x" phase="go"/>'},
        *("$runs}", "TrafficSignalControllerCondition.trafficSignalControllerRef is 'x', which does not exist"),
    ),
    (
        {
            TIME: TIME.replace("SimulationTimeCondition", "StoryboardElementStateCondition").replace(
                'value="${1 + $runs}" rule="greaterThan"',
                'storyboardElementType="event" storyboardElementRef="act::event" state="completeState"',
            )
        },
        *("$runs}", "'act::event', which does not exist; did you mean"),
    ),
    ({POSITION: POSITION.replace("-1", "left")}, POSITION, "LanePosition.laneId is 'left'; must be an integer"),
    ({POSITION: POSITION.replace("50", "1e300")}, POSITION, "LanePosition.s is '1e300'; must be a finite number of at"),
    (
        {'cubic" value="3" dynamicsDimension="time"': 'cubic" value="0" dynamicsDimension="rate"'},
        "<LaneChangeAction>",
        "<LaneChangeAction> has dynamics with value 0; a rate must be above 0, or its shape step",
    ),
    ({TIME: '<SpeedCondition value="1" rule="lessThan"/>'}, 'name="time"', "<Condition> must have TriggeringEntities"),
    ({'ScenarioObject name="other"': f'ScenarioObject name="{"x" * 201}"'}, None, "name has 201 characters; must have"),
    (
        {ACTION: global_action("owner", '<ModifyAction><Rule><AddValue value="1"/></Rule></ModifyAction>')},
        None,
        "must be a number",
    ),
    ({ACTION: global_action("runs", '<SetAction value="x"/>')}, None, "SetAction is 'x'; must be an integer"),
    (
        {ACTION: follow("<Polyline>" + VERTEX.format(3) + VERTEX.format(2) + "</Polyline>")},
        None,
        "have times in ascending",
    ),
    ({ACTION: follow(NURBS)}, None, "<Nurbs> must have knots in ascending order"),
    ({ACTION: follow(NURBS.replace('"0"', '"1"'))}, None, "<Nurbs> must have knots in ascending order"),
    (
        {ACTION: f"<PrivateAction><LongitudinalAction>{DISTANCE}</LongitudinalAction></PrivateAction>"},
        None,
        "must have a distance or a timeGap",
    ),
    ({POSITION: POSITION * 2}, None, "<TeleportAction> must have 1 of WorldPosition or"),
    ({POSITION: ""}, None, "<TeleportAction> must have 1 of WorldPosition or"),
    (
        {POSITION: '<GeoPosition latitude="48" longitude="11"/>'},
        POSITION,
        "is not on Earth; a latitude without Deg is in radians",
    ),
    ({'ScenarioObject name="other"': 'ScenarioObject name="ego"'}, None, "2 entities are called ego"),
    (
        {"</Entities>": "</Entities><MonitorDeclarations/>"},
        "</Entities>",
        "<MonitorDeclarations> in <OpenSCENARIO> is not supported",
    ),
]


@pytest.mark.parametrize(("edits", "line", "words"), ERRORS)
def test_a_problem_is_named_with_its_line(edits: dict[str, str], line: str | None, words: str, tmp_path: Path) -> None:
    found = problems(tmp_path, edits)
    place = "" if line is None else f"scenario.xosc:{line_with(line)}:"
    assert any(problem.startswith(place) and words in problem for problem in found), found


def test_a_path_of_names_may_begin_at_any_level(tmp_path: Path) -> None:
    condition = 'storyboardElementType="{}" storyboardElementRef="{}" state="completeState"'
    for kind, path in (
        ("event", "event"),
        ("event", "maneuver::event"),
        ("maneuverGroup", "act::group"),
        ("story", "story"),
    ):
        new = f"<StoryboardElementStateCondition {condition.format(kind, path)}/>"
        assert (
            read(tmp_path, {TIME: new}).storyboard.stories[0].acts[0].start_trigger.groups[0].conditions[0].test.state
        )


def test_values_outside_the_constraints_are_refused(tmp_path: Path) -> None:
    constraints = "".join(
        f'<ConstraintGroup><ValueConstraint rule="{rule}" value="{value}"/></ConstraintGroup>'
        for rule, value in (("lessThan", "15"), ("equalTo", "20"))
    )
    declaration = '<ParameterDeclaration name="$speed" parameterType="double" value="13.5"'
    edits = {f"{declaration}/>": f"{declaration}>{constraints}</ParameterDeclaration>"}
    assert read(tmp_path, edits, speed=20).entities[0].body.performance.max_speed_mps == 20
    assert "parameter speed is '16'; must be lessThan 15 or equalTo 20" in problems(tmp_path, edits, speed=16)[0]


def test_a_parameter_without_a_valid_value_is_one_problem(tmp_path: Path) -> None:
    assert len(problems(tmp_path, {'"double" value="13.5"': '"double" value="x"'})) == 1


def test_an_unknown_given_value_is_refused(tmp_path: Path) -> None:
    assert problems(tmp_path, {}, velocity=3)[0].endswith("has no parameter velocity; declared: speed, runs, owner")


def test_a_catalog_that_refers_to_itself_is_refused(tmp_path: Path) -> None:
    reference = '<CatalogReference catalogName="Cars" entryName="sedan"/>'
    path = write_hand_written_scenario(
        tmp_path, catalog=CATALOG.replace("</BoundingBox>", f"</BoundingBox>{reference}")
    )
    with pytest.raises(
        InputError, match=r"cars\.xosc:\d+: with its catalogs, the scenario is nested more than 64 deep"
    ):
        resolve(path)


def test_catalogs_that_multiply_each_other_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(resolving, "MAX_SCENARIO_ELEMENTS", 5_000)
    entries = [
        f'<Route name="r{n}">' + f'<CatalogReference catalogName="Many" entryName="r{n + 1}"/>' * 9 + "</Route>"
        for n in range(20)
    ]
    entries.append('<Route name="r20"/>')
    head = SCENARIO[: SCENARIO.index("<ParameterDeclarations>")]
    (tmp_path / "catalogs").mkdir()
    (tmp_path / "catalogs/many.xosc").write_text(
        f'{head}<Catalog name="Many">{"".join(entries)}</Catalog></OpenSCENARIO>'
    )
    path = write_hand_written_scenario(tmp_path, {'"Cars" entryName="sedan"/>': '"Many" entryName="r0"/>'})
    with pytest.raises(
        InputError, match="the scenario with its parameters and catalogs has more than 5,000 elements or 16 MiB"
    ):
        resolve(path)


def test_a_parameter_that_is_multiplied_to_a_huge_document_is_refused(tmp_path: Path) -> None:
    edits = {
        'value="ego"': 'value="{}"'.format("x" * 200_000),
        "<StopTrigger/>": "<StopTrigger/>" + '<X y="$owner"/>' * 90,
    }
    assert "with its parameters and catalogs has more than 300,000 elements or 16 MiB" in problems(tmp_path, edits)[0]


def test_reading_ends_early_if_there_are_very_many_problems(tmp_path: Path) -> None:
    found = problems(tmp_path, {"</Entities>": "</Entities>" + "".join(f"<X{number}/>" for number in range(20_000))})
    assert len(found) == 51
    assert found[-1] == "and 151 more problems"


def test_a_document_that_is_none_is_refused() -> None:
    with pytest.raises(InputError, match="the scenario's document:1: <OpenSCENARIO> must have 1 of FileHeader, not 0"):
        read_resolved("<OpenSCENARIO/>")


def test_rates_have_no_sign_and_labels_may_be_what_no_expression_is(tmp_path: Path) -> None:
    edits = {
        'value="3" dynamicsDimension="time"': 'value="-3" dynamicsDimension="rate"',
        'name="near"': 'name="${near + _ + $speed}"',
    }
    event = first_event(read(tmp_path, edits))
    assert event.actions[0].parts[0].dynamics.value == 3
    assert event.start_trigger.groups[0].conditions[0].name == "${near + _ + $speed}"
