"""Draw groups: of the pedestrians of a scene, some walk beside another one, on its route and at its speed."""

from collections.abc import Iterable

from simbev_ros.foundation.random import stream
from simbev_ros.scene.blueprints import blueprint_named
from simbev_ros.scene.gait import transition_mps
from simbev_ros.schema.scene.spec import MAX_GROUP_SIZE, PedestrianSpec

_TOGETHER = {"jaywalks": False, "visits_plazas": False}


def with_groups(pedestrians: Iterable[PedestrianSpec], seed: int, probability: float) -> list[PedestrianSpec]:
    """Let pedestrians join the group of the one before them.

    Members start side by side. They neither jaywalk nor visit plazas, because they might lose each other there. Only
    walkers form groups, and nobody joins a group that is too fast to walk with.

    Args:
        pedestrians: Pedestrians of the scene, drawn one by one.
        seed: Seed of the scene.
        probability: Probability that a pedestrian joins, if it can.
    """
    grouped, leader = list(pedestrians), 0
    for index in range(1, len(grouped)):
        first, own = grouped[leader], grouped[index]
        can_join = index - leader < MAX_GROUP_SIZE and all(
            _walks_at(each, first.max_speed_mps) for each in (first, own)
        )
        if can_join and stream(seed, f"pedestrians.{index}.joins").random() < probability:
            shared = {"start": first.start, "max_speed_mps": first.max_speed_mps, "companion_of": leader}
            grouped[leader] = first.model_copy(update=_TOGETHER)
            grouped[index] = own.model_copy(update=_TOGETHER | shared)
        else:
            leader = index
    return grouped


def _walks_at(pedestrian: PedestrianSpec, speed_mps: float) -> bool:
    """Whether a pedestrian is a walker who need not run at a speed."""
    blueprint = blueprint_named(pedestrian.blueprint)
    max_mps = transition_mps(blueprint.tall_m)
    return bool(blueprint.runs_as) and speed_mps <= min(max_mps, blueprint.max_speed_mps or max_mps)
