"""The weather that the sensors of an ego meet: in a tunnel there is neither rain nor fog."""

from dataclasses import replace

from simbev_ros.maps.roads.tunnels import Tunnels
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.sensors.mount import vector


def with_local_weather(state: WorldState, tunnels: Tunnels) -> WorldState:
    """The state with the weather at the ego."""
    if not tunnels or not tunnels.holds(vector(state.ego, "x y z")[None])[0]:
        return state
    return replace(state, weather=state.weather.sheltered())
