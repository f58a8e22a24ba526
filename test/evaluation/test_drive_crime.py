"""Time to collision and jerk against commonroad-crime, where it is installed."""

from typing import Any

import numpy as np
import pytest
from drive_cases import EGO_ID, RIGHT_M, TICK_S, actor, spec, state, straight

from simbev_ros.evaluation.driving.moment import Moment
from simbev_ros.evaluation.driving.motion import comfort_variables
from simbev_ros.evaluation.driving.rules.time_to_collision import STEP_S, times_to_collision_s

pytest.importorskip("commonroad_crime")
pytestmark = pytest.mark.filterwarnings("ignore")  # of its libraries

TICKS = 60
JERK_MPS3, START_MPS = 1.5, 6.0


def scenario(ego: Any, other: Any) -> Any:
    """A straight lane along x with two cars, given by functions from a time to x, speed and acceleration."""
    from commonroad.geometry.shape import Rectangle
    from commonroad.prediction.prediction import TrajectoryPrediction
    from commonroad.scenario.lanelet import Lanelet
    from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType
    from commonroad.scenario.scenario import Scenario
    from commonroad.scenario.state import CustomState, InitialState
    from commonroad.scenario.trajectory import Trajectory

    x_m = np.linspace(-50.0, 500.0, 56)
    lines = [np.column_stack([x_m, np.full(len(x_m), RIGHT_M + y)]) for y in (1.75, 0.0, -1.75)]
    made = Scenario(dt=TICK_S)
    made.add_objects(Lanelet(lines[0], lines[1], lines[2], 1))
    for number, motion in ((100, ego), (200, other)):
        states = []
        for tick in range(TICKS):
            at_m, speed_mps, acceleration_mps2 = motion(tick * TICK_S)
            place_m = np.array([at_m, RIGHT_M])
            kind, more = (CustomState, {}) if tick else (InitialState, {"yaw_rate": 0.0, "slip_angle": 0.0})
            values = {"position": place_m, "orientation": 0.0, "velocity": speed_mps, "acceleration": acceleration_mps2}
            states.append(kind(time_step=tick, **values, **more))
        shape = Rectangle(4.0, 2.0)
        prediction = TrajectoryPrediction(Trajectory(1, states[1:]), shape)
        made.add_objects(DynamicObstacle(number, ObstacleType.CAR, shape, states[0], prediction))
    made.assign_obstacles_to_lanelets()
    return made


def measure(name: str, made: Any, tick: int) -> float:
    import commonroad_crime.measure as measures
    from commonroad_crime.data_structure.configuration import CriMeConfiguration

    config = CriMeConfiguration()
    config.update(ego_id=100, sce=made)
    computed = getattr(measures, name)(config)
    if name == "TTC":
        return float(computed.compute(200, tick, verbose=False))
    return float(computed.compute(tick, 200, verbose=False))


@pytest.mark.parametrize(("own_mps", "other_mps", "gap_m"), [(15.0, 5.0, 20.0), (20.0, 12.0, 9.0), (8.0, 0.0, 16.0)])
def test_time_to_collision_is_that_of_commonroad_up_to_its_steps(
    own_mps: float, other_mps: float, gap_m: float
) -> None:
    ahead_m = gap_m + 4.0
    made = scenario(lambda t: (own_mps * t, own_mps, 0.0), lambda t: (ahead_m + other_mps * t, other_mps, 0.0))
    for tick in (0, 5, 10, 15):
        rows = [
            actor(EGO_ID, straight(own_mps, 0.0), tick * TICK_S),
            actor(2, straight(other_mps, ahead_m), tick * TICK_S),
        ]
        moment = Moment(state(spec(), tick, rows), TICK_S, None, 0.0)
        found, expected = float(times_to_collision_s(moment, moment.others)[0]), measure("TTC", made, tick)
        assert expected == pytest.approx(
            (gap_m - (own_mps - other_mps) * tick * TICK_S) / (own_mps - other_mps), abs=0.01
        )
        assert -0.01 <= found - expected <= STEP_S + 0.01


def test_jerk_is_that_of_commonroad() -> None:
    def ego(time_s: float) -> tuple[float, float, float]:
        at_m = START_MPS * time_s + JERK_MPS3 * time_s**3 / 6.0
        return at_m, START_MPS + JERK_MPS3 * time_s**2 / 2.0, JERK_MPS3 * time_s

    made = scenario(ego, lambda t: (300.0, 0.0, 0.0))
    rows = np.array([[ego(tick * TICK_S)[2], 0.0, 0.0, ego(tick * TICK_S)[2], 0.0] for tick in range(TICKS)])
    found = comfort_variables(rows, TICK_S)
    for tick in (10, 20, 30):
        assert found["longitudinal_jerk"][tick] == pytest.approx(measure("LongJ", made, tick), abs=0.01)
        assert found["jerk"][tick] == pytest.approx(JERK_MPS3)
