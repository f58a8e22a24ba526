"""Checks the references of a resolved scenario: to entities, parts of the storyboard, parameters and controllers."""

from collections import Counter
from collections.abc import Iterable, Iterator

from simbev_ros.scene.storyboard.model import SPECS, Element, elements_in
from simbev_ros.scene.storyboard.parameters import read_value
from simbev_ros.scene.storyboard.problems import Problems, listed


def check_references(scenario: Element, problems: Problems) -> None:
    """Note every reference that leads nowhere, and values that contradict each other.

    Args:
        scenario: The model of a whole scenario.
        problems: Receives what is wrong.
    """
    controllers = [item for entity in scenario.entities for item in entity.controllers]
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
        _check_values(element, problems)


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


def _check_values(element: Element, problems: Problems) -> None:
    """Note values of an element that contradict each other."""
    if element.kind == "Nurbs":
        number = len(element.control_points) + element.order
        if len(element.knots) != number or not 2 <= element.order <= len(element.control_points):
            words = f"<Nurbs> of order {element.order} with {len(element.control_points)} control points"
            problems.add(
                element.origin, f"{words} must have {number} knots, not {len(element.knots)}, and no higher order"
            )
    elif element.kind == "GeoPosition" and not (abs(element.latitude_deg) <= 90 and abs(element.longitude_deg) <= 180):
        problems.add(element.origin, "<GeoPosition> is not on Earth; a latitude without Deg is in radians")
