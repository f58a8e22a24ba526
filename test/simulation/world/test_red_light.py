"""The ego at a red light, observed from actors and signals only: a careful driver stops, a reckless one drives on."""

import numpy as np
import pytest
from world_scenes import blocks, run, scene

from simbev_ros.foundation.types import Float64Array
from simbev_ros.schema.scene.state import Behavior, SignalState, WorldState

_LATERAL_M = 1.5


def fronts_m(states: list[WorldState]) -> Float64Array:
    """(T, 2) center of the ego's front bumper."""
    ego = np.array([state.ego for state in states])
    ahead = np.stack([np.cos(ego["yaw"]), np.sin(ego["yaw"])], axis=1)
    return np.stack([ego["x"], ego["y"]], axis=1) + ego["length"][:, None] / 2.0 * ahead


def lights_passed(states: list[WorldState]) -> list[tuple[int, SignalState]]:
    """Index of each state in which the ego's front bumper has just crossed a stop line, and the state of its light."""
    front_m, passed = fronts_m(states), []
    for row, head in enumerate(blocks().signals):
        line_m = blocks().lanes[head.lane].centerline_m[-2:, :2]
        ahead = (line_m[1] - line_m[0]) / np.linalg.norm(line_m[1] - line_m[0])
        beyond_m = (front_m - line_m[1]) @ ahead
        lateral_m = (front_m - line_m[1]) @ np.array([-ahead[1], ahead[0]])
        crossed = (beyond_m[:-1] < 0.0) & (beyond_m[1:] >= 0.0) & (np.abs(lateral_m[1:]) < _LATERAL_M)
        for index in (np.flatnonzero(crossed) + 1).tolist():
            passed.append((index, SignalState(int(states[index].signals["state"][row]))))
    return sorted(passed)


def ego_alone(reckless: bool) -> list[WorldState]:
    spec = scene(vehicles=1, pedestrians=0, ticks=640, seed=0, green_time_s=(20.0,))
    ego = spec.vehicles[0].model_copy(update={"reckless": reckless})
    return run(spec.model_copy(update={"vehicles": (ego,)}))


@pytest.mark.slow
def test_a_reckless_ego_drives_through_a_red_light_at_which_a_careful_one_stops() -> None:
    careful, reckless = ego_alone(False), ego_alone(True)
    assert (careful[-1].ego["behavior"], reckless[-1].ego["behavior"]) == (0, Behavior.RECKLESS)
    index, shown = lights_passed(reckless)[0]
    assert shown is SignalState.RED
    assert np.hypot(reckless[index].ego["vx"], reckless[index].ego["vy"]) > 4.0
    stop_m = fronts_m(reckless)[index]
    index, shown = lights_passed(careful)[0]
    assert shown is SignalState.GREEN
    assert np.linalg.norm(fronts_m(careful)[index] - stop_m) < _LATERAL_M  # the same light
    speed_mps = np.array([np.hypot(state.ego["vx"], state.ego["vy"]) for state in careful[:index]])
    is_waiting = speed_mps[100:] < 0.1
    assert is_waiting.any()
    gap_m = np.linalg.norm(fronts_m(careful)[100:index][is_waiting] - stop_m, axis=1)
    assert gap_m.max() < 5.0
