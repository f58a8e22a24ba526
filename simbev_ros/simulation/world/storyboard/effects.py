"""Actions that take effect at once: on values, weather, lights, signals, and on whether an entity is in the scene."""

from collections.abc import Callable, Mapping

from simbev_ros.scene.storyboard.bodies import Body
from simbev_ros.scene.storyboard.model import Element
from simbev_ros.simulation.world.storyboard.stage import Stage


def _environment(stage: Stage, element: Element) -> None:
    environment = element.environment
    if environment.time_of_day is not None:
        stage.clock = environment.time_of_day.date_time, stage.time_s, environment.time_of_day.animation
    stage.weather(environment)


def _entity(stage: Stage, element: Element) -> None:
    body = stage.bodies[element.entity_ref]
    if element.change.kind == "AddEntityAction":
        stage.mover.put(body, stage.positions.pose(element.change.position))
    else:
        body.is_present = False


def _value(stage: Stage, element: Element) -> None:
    name, change = element.parameter_ref if element.kind == "ParameterAction" else element.variable_ref, element.change
    if change.kind == "SetAction":
        stage.values[name] = change.value
        return
    number = float(stage.values[name])
    rule = change.rule
    stage.values[name] = repr(number + rule.value if rule.kind == "AddValue" else number * rule.value)


def _signal(stage: Stage, element: Element) -> None:
    stage.signals.states[element.name] = element.state


def _signal_phase(stage: Stage, element: Element) -> None:
    stage.signals.start_phase(element.traffic_signal_controller_ref, element.phase, stage.time_s)


GLOBAL_EFFECTS: Mapping[str, Callable[[Stage, Element], None]] = {
    "EnvironmentAction": _environment,
    "EntityAction": _entity,
    "ParameterAction": _value,
    "VariableAction": _value,
    "TrafficSignalStateAction": _signal,
    "TrafficSignalControllerAction": _signal_phase,
}
"""Actions of the whole scene."""


def _visibility(stage: Stage, body: Body, element: Element) -> None:
    (stage.hidden.discard if element.graphics or element.sensors else stage.hidden.add)(body.name)


def _lights(stage: Stage, body: Body, element: Element) -> None:
    if element.light.kind == "VehicleLight":
        stage.lights[body.name, element.light.vehicle_light_type] = element.state.mode


def _nothing(stage: Stage, body: Body, element: Element) -> None:
    """The storyboard itself controls all entities."""


EFFECTS: Mapping[str, Callable[[Stage, Body, Element], None]] = {
    "VisibilityAction": _visibility,
    "LightStateAction": _lights,
    "ActivateControllerAction": _nothing,
    "AssignControllerAction": _nothing,
}
"""Actions of one entity."""
