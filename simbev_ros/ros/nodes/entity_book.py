"""Names and descriptions of the entities of a running scene, which tables do not have."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from simbev_ros.foundation.types import Table
from simbev_ros.scene.blueprints import Blueprint, load_blueprints
from simbev_ros.schema.scene.agents import AgentView
from simbev_ros.schema.scene.state import Behavior

CATEGORIES = _, ROBOT, HUMAN, DYNAMIC_OBJECT, STATIC_OBJECT = 0, 1, 2, 4, 5
"""Numbers of simulation_interfaces/msg/EntityCategory; the first is that of any other object."""
_OF_KIND = {"pedestrian": HUMAN, "vehicle": DYNAMIC_OBJECT, "trailer": DYNAMIC_OBJECT}


@dataclass(frozen=True, slots=True)
class EntityFacts:
    """Description of an entity: its category, words and tags."""

    category: int
    description: str
    tags: tuple[str, ...]


class EntityBook:
    """Names and facts in one scene.

    Vehicles of agents have the names of these, other actors that of their model and their id: ``vehicle.sedan_12``.

    Attributes:
        agents: What drives the vehicle of each agent, by its id.
    """

    def __init__(self, views: Iterable[AgentView]) -> None:
        """Start a scene with agents."""
        carried = [view for view in views if view.vehicle is not None]
        self.agents = {view.ego_id: view.spec.driver for view in carried}
        self._names = {view.ego_id: view.agent for view in carried}
        self._facts: dict[int, EntityFacts] = {}
        self._spawned: set[int] = set()

    def name_spawned(self, actor: int, name: str) -> None:
        """Give a spawned actor its name."""
        self._names[actor] = name
        self._spawned.add(actor)

    def forget(self, actor: int) -> None:
        """Forget a deleted actor; its name can be given again."""
        self._names.pop(actor, None)
        self._facts.pop(actor, None)

    def describe(self, actor: int, facts: EntityFacts) -> None:
        """Replace the facts of an entity."""
        self._facts[actor] = facts

    def named_rows(self, actors: Table) -> dict[str, Table]:
        """Rows of (N,) ``ACTOR_DTYPE`` by name; riders and what is towed are parts of their vehicles."""
        return {self._name(row): row for row in self._entities(actors)}

    def facts(self, row: Table) -> EntityFacts:
        """Facts of the entity with this row."""
        if (facts := self._facts.get(int(row["id"]))) is not None:
            return facts
        model, actor, behavior = load_blueprints()[int(row["blueprint"])], int(row["id"]), int(row["behavior"])
        category = ROBOT if actor in self.agents else _OF_KIND.get(model.kind, STATIC_OBJECT)
        marks = {
            "agent": actor in self.agents,
            "spawned": actor in self._spawned,
            "parked": behavior & Behavior.PARKED,
            "sitting": behavior & Behavior.SITTING,
        }
        held = (mark for mark, holds in marks.items() if holds)
        words = [model.kind, model.box_class, *model.name.split(".")[1:], *held]
        return EntityFacts(category, describe_model(model), tuple(dict.fromkeys(filter(None, words))))

    def _entities(self, actors: Table) -> Iterator[Table]:
        is_towed = np.array([each.kind == "trailer" for each in load_blueprints()])[actors["blueprint"]]
        is_towed &= (actors["behavior"] & Behavior.PARKED == 0) & ~np.isin(actors["id"], sorted(self._spawned))
        yield from actors[(actors["parent"] == 0) & ~is_towed]

    def _name(self, row: Table) -> str:
        actor = int(row["id"])
        return self._names.get(actor) or f"{load_blueprints()[int(row['blueprint'])].name}_{actor}"


def describe_model(model: Blueprint) -> str:
    """A model in words."""
    length_m, width_m, height_m = model.size_m
    name = " ".join(model.name.split(".")[1:]).replace("_", " ")
    return f"{model.kind} {name}, {length_m:.2f} m x {width_m:.2f} m x {height_m:.2f} m"
