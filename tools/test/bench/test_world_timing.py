"""The benchmark of the world times scenes of each size, with as many people and vehicles as were asked for."""

import numpy as np
import pytest

from simbev_ros.config.rig import Rig
from simbev_ros.config.scenario import Scenario
from tools.bench.world_timing import timed_world


@pytest.mark.slow
def test_world_bench_times_scenes_of_every_size() -> None:
    scenario = Scenario.model_validate(
        {"scenes": [{"map": "Blocks", "train": 1}], "rig": Rig(sensors=()), "time": {"duration_s": 1}}
    )
    timing = timed_world(scenario, "Blocks", counts=(6, 60))
    assert [scene.people for scene in timing.scenes] == [4, 40]
    assert all(scene.vehicles >= wanted for scene, wanted in zip(timing.scenes, (2, 20), strict=True))
    assert all(0.0 < scene.mean_ms <= scene.p99_ms and scene.cpu_ms > 0.0 for scene in timing.scenes)
    assert np.isfinite(timing.growth)
