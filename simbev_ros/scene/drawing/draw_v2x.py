"""Draw the messages that the agents of a scene send each other."""

from collections.abc import Collection

from simbev_ros.config.draw import sample
from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.random import stream
from simbev_ros.schema.scene.v2x_spec import V2xSpec


def draw_v2x(scenario: Scenario, seed: int, names: Collection[str]) -> V2xSpec | None:
    """Draw the range of the messages; None: the configuration wants none, or fewer than two agents would take part.

    Args:
        scenario: The configuration.
        seed: Seed of the scene.
        names: Names of the agents of the scene, in their order.
    """
    agents = [name for name in names if name in scenario.v2x_agents]
    if scenario.v2x is None or len(agents) < 2:
        return None
    range_m = sample(scenario.v2x.range_m, stream(seed, "v2x.range"))
    return V2xSpec.model_validate(dict(scenario.v2x) | {"range_m": range_m, "agents": agents})
