import pytest
from pydantic import ValidationError

from simbev_ros.schema.scene.drive_spec import Command, RouteSpec

COLUMNS = {
    "x_m": (0.0, 1.0),
    "y_m": (0.0, 0.0),
    "z_m": (0.0, 0.5),
    "distance_m": (0.0, 1.0),
    "limit_mps": (8.0, 8.0),
    "lane": ("a_0", "a_0"),
    "command": (Command.FOLLOW, Command.FOLLOW),
}


def test_goal_is_as_far_as_the_last_point() -> None:
    route = RouteSpec.model_validate(COLUMNS)
    assert route.length_m == 1.0
    assert route.points_m.tolist() == [[0, 0, 0], [1, 0, 0.5]]


@pytest.mark.parametrize("change", [{"lane": ("a_0",)}, {"distance_m": (0.0, 0.0)}, {"distance_m": (1.0, 2.0)}])
def test_columns_that_contradict_each_other_are_refused(change: dict[str, object]) -> None:
    with pytest.raises(ValidationError, match="route"):
        RouteSpec.model_validate(COLUMNS | change)
