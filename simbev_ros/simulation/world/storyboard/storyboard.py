"""The storyboard as a state machine: stories, acts, maneuver groups, maneuvers, events and actions, tick by tick.

Elements are in standby, running or complete, and change by the transitions start, end, stop and skip (ASAM OpenSCENARIO
XML 1.3, "Storyboard and entities"). At each tick all entities move, then actions that have reached their goals end with
what contains them, then triggers are evaluated in the order of the file. Conditions see the transitions of this tick's
endings and of the triggers at the tick before.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import StrEnum

from simbev_ros.scene.storyboard.model import Element, elements_in
from simbev_ros.simulation.world.storyboard.actions import MOTIONS
from simbev_ros.simulation.world.storyboard.conditions import Trigger
from simbev_ros.simulation.world.storyboard.effects import EFFECTS, GLOBAL_EFFECTS
from simbev_ros.simulation.world.storyboard.stage import Motion, Stage


class State(StrEnum):
    """State of an element, by the standard's name."""

    STANDBY = "standbyState"
    RUNNING = "runningState"
    COMPLETE = "completeState"


START, END, STOP, SKIP = "startTransition", "endTransition", "stopTransition", "skipTransition"
_CHILDREN = {"Story": "acts", "Act": "maneuver_groups", "ManeuverGroup": "maneuvers", "Maneuver": "events"}


@dataclass(slots=True, eq=False)
class Part:
    """One element of a storyboard at run time.

    Attributes:
        kind: Name of the element.
        path: Names from the story down to it, with slashes.
        element: The element.
        parent: The element around it.
        parts: The elements in it.
        state: Its state.
        executions: Number of its starts and skips.
        start: Start trigger.
        stop: Stop trigger.
        actors: Of a running event, its actors.
        motions: Of a running action, what moves entities.
    """

    kind: str
    path: str
    element: Element
    parent: "Part | None" = None
    parts: list["Part"] = field(default_factory=list)
    state: State = State.STANDBY
    executions: int = 0
    start: Trigger | None = None
    stop: Trigger | None = None
    actors: tuple[str, ...] = ()
    motions: list[Motion] = field(default_factory=list)

    @property
    def max_executions(self) -> int:
        """How often it may start."""
        return int(getattr(self.element, "maximum_execution_count", 1))

    def __iter__(self) -> Iterator["Part"]:
        """It and all elements in it, in the order of the file."""
        yield self
        for part in self.parts:
            yield from part


def _part(element: Element, parent: Part | None) -> Part:
    path = element.name if parent is None else f"{parent.path}/{element.name}"
    part = Part(element.kind, path, element, parent)
    children = element.actions if element.kind == "Event" else getattr(element, _CHILDREN.get(element.kind, ""), ())
    part.parts = [_part(child, part) for child in children]
    for name in ("start", "stop"):
        trigger = getattr(element, f"{name}_trigger", None)
        setattr(part, name, None if trigger is None else Trigger(trigger))
    return part


class Storyboard:
    """Runs one storyboard on a stage.

    Attributes:
        changes: Transitions of the latest tick as (transition, element), in order.
        has_stopped: Whether the stop trigger has been true.
    """

    def __init__(self, element: Element, stage: Stage) -> None:
        """Prepare it; ``element`` is a ``Storyboard``."""
        self._element, self._stage = element, stage
        stage.mover.watches_roads = any(each.kind == "OffroadCondition" for each in elements_in(element))
        self._stories = [_part(story, None) for story in element.stories]
        self._stop = None if element.stop_trigger is None else Trigger(element.stop_trigger)
        self._seen: set[tuple[str, Part]] = set()
        self._begun = self.has_stopped = False
        self._endings = 0
        self.changes: list[tuple[str, Part]] = []

    @property
    def parts(self) -> Iterator[Part]:
        """All elements from the stories down, in the order of the file."""
        for story in self._stories:
            yield from story

    def initialize(self) -> None:
        """Run the actions of ``Init``: placements first, as other actions may refer to other entities' positions."""
        init = self._element.init
        self._stage.positions.enter(init)
        for element in init.global_actions:
            GLOBAL_EFFECTS[element.kind](self._stage, element)
        for private in init.privates:
            for action in private.actions:
                if action.kind != "TeleportAction":
                    with self._stage.noted("the action has no effect"):
                        self._perform(action, private.entity_ref, in_init=True)

    def advance(self) -> None:
        """Run the storyboard at the time of the stage, whose entities have moved to it."""
        former, self.changes = self.changes[self._endings :], []
        for story in self._stories:
            (self._finish if self._begun else self._begin)(story)
        self._begun, self._endings = True, len(self.changes)
        self._seen = {*former, *self.changes, *((str(part.state), part) for part in self.parts)}
        if self._stop is not None and not self.has_stopped and self._stop.evaluate(self._stage, self).holds:
            self.has_stopped = True
            for story in self._stories:
                self._halt(story)
            return
        for part in [*self.parts]:
            self._check(part)

    def has_state(self, kind: str, reference: str, state: str) -> bool:
        """As in ``States``; a reference is a name, or the end of a path with slashes or ``::``."""
        path = reference.replace("::", "/")
        return any(
            part.kind.lower() == kind.lower() and f"/{part.path}".endswith(f"/{path}")
            for seen, part in self._seen
            if seen == state
        )

    def _note(self, transition: str, part: Part, state: State) -> None:
        part.state = state
        self.changes.append((transition, part))

    def _begin(self, part: Part) -> None:
        """Start an element; what is in it waits for its trigger, or starts too."""
        part.executions += 1
        self._note(START, part, State.RUNNING)
        for child in part.parts:
            self._await(child)

    def _await(self, part: Part) -> None:
        """Let an element wait for its start; one without a trigger of its own starts with what it is in."""
        part.state, part.executions = State.STANDBY, 0
        for trigger in (part.start, part.stop):
            if trigger is not None:
                trigger.reset()
        if part.start is None and part.kind not in ("Event", "Action"):
            self._begin(part)

    def _check(self, part: Part) -> None:
        """Evaluate the triggers of an element whose parent runs."""
        if part.parent is not None and part.parent.state is not State.RUNNING:
            return
        if part.state is State.COMPLETE:
            return
        if part.stop is not None and part.stop.evaluate(self._stage, self).holds:
            self._halt(part)
            return
        if part.state is not State.STANDBY or part.kind == "Action":
            return
        if part.start is None:
            self._start_event(part, ())
            return
        verdict = part.start.evaluate(self._stage, self)
        if verdict.holds and part.kind == "Event":
            self._start_event(part, verdict.entities)
        elif verdict.holds:
            self._begin(part)

    def _start_event(self, event: Part, triggering: tuple[str, ...]) -> None:
        """Start an event, by its priority over the others in its maneuver."""
        assert event.parent is not None and event.parent.parent is not None
        running = [each for each in event.parent.parts if each.state is State.RUNNING and each is not event]
        event.executions += 1
        if event.element.priority == "skip" and running:
            left = event.executions < event.max_executions
            self._note(SKIP, event, State.STANDBY if left else State.COMPLETE)
            return
        if event.element.priority == "override":
            for each in running:
                self._halt(each)
        group = event.parent.parent.element.actors
        named = [reference.entity_ref for reference in group.entities]
        event.actors = tuple(dict.fromkeys([*named, *(triggering if group.select_triggering_entities else ())]))
        self._note(START, event, State.RUNNING)
        for action in event.parts:
            action.motions = []
            self._note(START, action, State.RUNNING)
            for element in action.element.parts:
                for name in event.actors if element.kind not in GLOBAL_EFFECTS else (None,):
                    with self._stage.noted("the action has no effect"):
                        if name is None:
                            GLOBAL_EFFECTS[element.kind](self._stage, element)
                        elif (motion := self._perform(element, name)) is not None:
                            action.motions.append(motion)
        self._finish(event)

    def _perform(self, element: Element, name: str, *, in_init: bool = False) -> Motion | None:
        """Start an action of an entity; one driven from outside obeys only effects, and those of ``Init``."""
        body = self._stage.bodies[name]
        if element.kind in EFFECTS:
            EFFECTS[element.kind](self._stage, body, element)
            return None
        if name in self._stage.outside and not in_init:
            note = f"{name} is driven from outside; actions of the storyboard that would move it have no effect"
            self._stage.notes[note] = None
            return None
        return MOTIONS[element.kind](self._stage, body, element)

    def _finish(self, part: Part) -> None:
        """End an element whose parts have all ended, from the inside out."""
        if part.state is not State.RUNNING:
            return
        for child in part.parts:
            self._finish(child)
        if part.kind == "Action":
            if all(motion.done for motion in part.motions):
                self._note(END, part, State.COMPLETE)
            return
        if not all(child.state is State.COMPLETE for child in part.parts):
            return
        again = part.executions < part.max_executions and part.kind in ("Event", "ManeuverGroup")
        self._note(END, part, State.STANDBY if again else State.COMPLETE)
        if again and part.kind == "Event":
            for trigger in (part.start, part.stop):
                if trigger is not None:
                    trigger.reset()
        elif again:
            self._begin(part)

    def _halt(self, part: Part) -> None:
        """Stop an element with all that is in it."""
        if part.state is State.COMPLETE:
            return
        for child in part.parts:
            self._halt(child)
        for motion in part.motions:
            motion.done = True
        self._note(STOP, part, State.COMPLETE)
