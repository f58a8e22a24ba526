"""Processes that draw cameras for timing: what goes wrong in one of them is said by the command."""

from collections.abc import Iterator
from typing import Any

import pytest

from simbev_ros.config.rendering import Rendering
from simbev_ros.foundation.errors import SimbevError
from simbev_ros.schema.scene.lights import LightSpec
from tools.bench.camera_scene import CameraScene
from tools.bench.camera_team import CameraTeam

pytestmark = [pytest.mark.gl, pytest.mark.slow]


@pytest.fixture
def team() -> Iterator[CameraTeam]:
    """Two processes with a scene that cannot be drawn."""
    nothing: Any = None
    views = [nothing] * 3
    with CameraTeam(CameraScene("nowhere", nothing, LightSpec(), []), views, Rendering(gpus=(), processes=2)) as team:
        assert team.processes == 2
        yield team
    assert not any(worker.is_alive() for worker in team._workers)


def test_what_fails_in_a_process_is_raised_here(team: CameraTeam) -> None:
    with pytest.raises(AttributeError, match="tiles"):
        team.prepare("low")


def test_a_process_that_was_killed_is_an_error(team: CameraTeam) -> None:
    team._workers[1].kill()
    with pytest.raises(SimbevError, match="a process that drew cameras was killed"):
        team.prepare("low")
