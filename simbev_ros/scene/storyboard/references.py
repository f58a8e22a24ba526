"""Checks the references of a resolved scenario: to entities, parts of the storyboard, parameters and controllers."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping

from simbev_ros.scene.storyboard.model import SPECS, TABLE, Element, elements_in
from simbev_ros.scene.storyboard.parameters import read_value
from simbev_ros.scene.storyboard.problems import Problems, listed
from simbev_ros.schema.scene.storyboard_spec import MAX_CAST, MAX_NAME_CHARS


def check_references(scenario: Element, problems: Problems) -> None:
    """Note every reference that leads nowhere, and values that contradict each other.

    Args:
        scenario: The model of a whole scenario.
        problems: Receives what is wrong.
    """
    controllers = [item for entity in scenario.entities for item in entity.controllers]
    types = {item.name: item.parameter_type for item in scenario.parameters}
    types |= {item.name: item.variable_type for item in scenario.variables}
    names = {
        "entity_ref": dict.fromkeys(entity.name for entity in scenario.entities),
        "parameter_ref": dict.fromkeys(item.name for item in scenario.parameters),
        "variable_ref": dict.fromkeys(item.name for item in scenario.variables),
        "traffic_signal_controller_ref": dict.fromkeys(item.name for item in scenario.road_network.signal_controllers),
        "object_controller_ref": dict.fromkeys(
            name for item in controllers for name in (item.name, item.controller.name) if name
        ),
    }
    names["master_entity_ref"] = names["entity_ref"]
    for name, count in Counter(entity.name for entity in scenario.entities).items():
        if count > 1:
            problems.add(scenario.origin, f"{count} entities are called {name:.80}")
        if not 0 < len(name) <= MAX_NAME_CHARS:
            problems.add(
                scenario.origin, f"an entity's name has {len(name)} characters; must have 1 to {MAX_NAME_CHARS}"
            )
    if len(scenario.entities) > MAX_CAST:
        problems.add(scenario.origin, f"it has {len(scenario.entities)} entities; allowed are {MAX_CAST}")
    for variable in scenario.variables:
        with problems.noted(variable.origin, f"variable {variable.name:.80}"):
            read_value(variable.variable_type, variable.value)
    parts = {kind: dict.fromkeys(_references(scenario.storyboard.stories, kind, ())) for kind in _LEVELS}
    for element in elements_in(scenario):
        known = {spec.name: (spec.attribute, names[spec.name]) for spec in SPECS[element.kind] if spec.name in names}
        if element.kind == "StoryboardElementStateCondition":
            known["storyboard_element_ref"] = ("storyboardElementRef", parts[element.storyboard_element_type])
        for field, (attribute, allowed) in known.items():
            name = getattr(element, field)
            if name is not None and name not in allowed:
                words = f"{element.kind}.{attribute} is {name!r:.80}, which does not exist"
                problems.add(element.origin, f"{words}{listed(name, allowed, 'there are')}")
        if element.kind in ("ParameterAction", "VariableAction"):
            _check_change(element, types, problems)
        else:
            for is_wrong, words in _faults(element):
                if is_wrong:
                    problems.add(element.origin, f"<{element.kind}> {words}")


_LEVELS = {"story": "acts", "act": "maneuver_groups", "maneuverGroup": "maneuvers", "maneuver": "events"}
_LEVELS |= {"event": "actions", "action": ""}
"""The field with the elements of the next level, by the types of elements of the storyboard."""


def _references(elements: Iterable[Element], kind: str, above: tuple[str, ...]) -> Iterator[str]:
    """All texts that refer to elements of a type: paths of names that end there and begin at any level."""
    for element in elements:
        path = (*above, element.name)
        level = list(_LEVELS)[len(above)]
        if level == kind:
            yield from ("::".join(path[start:]) for start in range(len(above), -1, -1))
        else:
            yield from _references(getattr(element, _LEVELS[level]), kind, path)


def _check_change(action: Element, types: Mapping[str, str], problems: Problems) -> None:
    """Note a new value that is not of its parameter's or variable's type, and arithmetic with a text."""
    name = action.parameter_ref if action.kind == "ParameterAction" else action.variable_ref
    kind = types.get(name, "double")
    with problems.noted(action.change.origin, action.change.kind):
        if action.change.kind == "SetAction":
            read_value(kind, action.change.value)
        elif kind in ("string", "boolean", "dateTime"):
            raise ValueError(f"changes a {kind}; must be a number")


def _faults(element: Element) -> Iterator[tuple[bool, str]]:
    """Whether values of an element contradict each other, and how."""
    match element.kind:
        case "Nurbs":
            knots, points, order = [each.value for each in element.knots], len(element.control_points), element.order
            words = f"of order {order} with {points} control points must have {points + order} knots, not {len(knots)}"
            yield len(knots) != points + order or not 2 <= order <= points, f"{words}, and no higher order"
            is_empty = knots[order - 1 : order] == knots[points : points + 1]
            yield knots != sorted(knots) or is_empty, "must have knots in ascending order"
        case "Polyline":
            times_s = [each.time_s for each in element.vertices if each.time_s is not None]
            yield times_s != sorted(times_s), "must have times in ascending order"
        case "GeoPosition":
            on_earth = abs(element.latitude_deg) <= 90 and abs(element.longitude_deg) <= 180
            yield not on_earth, "is not on Earth; a latitude without Deg is in radians"
        case "SpeedAction" | "LaneChangeAction":
            how = element.dynamics
            is_rate = how.dynamics_dimension == "rate" and how.dynamics_shape != "step"
            yield is_rate and how.value == 0, "has dynamics with value 0; a rate must be above 0, or its shape step"
        case "LongitudinalDistanceAction":
            given = (element.distance_m is not None) + (element.time_gap_s is not None)
            yield given != 1, "must have a distance or a timeGap, and not both"
        case "Condition":
            is_by_entity = element.test.kind in TABLE["unions"]["EntityTest"]
            words = "must have" if is_by_entity else "must not have"
            yield is_by_entity is (element.triggering_entities is None), f"{words} TriggeringEntities"
        case _:
            return
