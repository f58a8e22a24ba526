"""The sheet of all agents draws points and boxes where they are, in the color of the agent that sees them."""

import cooperative_scene as cooperative
import numpy as np
import pytest

from simbev_ros.dataset import open_dataset
from simbev_ros.drawing.canvas import DIM, TEXT
from simbev_ros.foundation.types import BoolArray, UInt8Array
from simbev_ros.show.sheet.agents_sheet import _COLORS, AgentsSheet, _Plan

EGO_COLOR, CAR_COLOR = _COLORS[:2]


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> tuple[AgentsSheet, UInt8Array]:
    """The sheet of a scene, and its picture of the first tick."""
    scene = open_dataset(cooperative.record(tmp_path_factory.mktemp("cooperative"))).scenes[0]
    sheet = AgentsSheet(scene, 1600)
    return sheet, sheet.draw(0)


def shows(picture: UInt8Array, color: tuple[int, int, int]) -> BoolArray:
    """(H, W) whether pixels have nearly a color."""
    return (np.abs(picture.astype(int) - color) < 12).all(axis=-1)


@pytest.mark.parametrize(
    ("number", "color"),
    [
        (cooperative.SEEN_BY_EGO, EGO_COLOR),
        (cooperative.SEEN_BY_CAR, CAR_COLOR),
        (cooperative.SEEN_BY_BOTH, TEXT),
        (cooperative.SEEN_BY_NONE, DIM),
    ],
)
def test_boxes_have_the_color_of_the_agent_that_sees_them(
    drawn: tuple[AgentsSheet, UInt8Array], number: int, color: tuple[int, int, int]
) -> None:
    sheet, picture = drawn
    assert picture.shape == (*reversed(sheet.size_px), 3) and picture.dtype == np.uint8
    plan = sheet._boxes[""]
    agents_m = np.array([cooperative.place_m(name, 0)[:2] for name in ("ego", "car")])
    x, y = _Plan(agents_m, plan.width).pixels(np.array(cooperative.PLACES_M[number]))
    row, column = round(plan.top + y), round(plan.left + x)
    scale = plan.width / _Plan(agents_m, plan.width).side_m
    half = round(2.5 * scale)  # the car is 4 m long
    around = picture[row - half : row + half, column - half : column + half]
    assert shows(around, color).sum() > 2 * scale
    for other in {EGO_COLOR, CAR_COLOR, TEXT, DIM} - {color}:
        assert not shows(around, other).any()


def test_points_are_where_they_are_in_the_map() -> None:
    plan = _Plan(np.array([[100.0, 50.0], [110.0, 50.0]]), 600)
    plan.add_points(np.array([[105.0, 70.0, 0.0], [105.0, 5000.0, 0.0]]), (255, 0, 0))
    rows, columns = np.nonzero(plan.picture()[..., 0] > 100)
    assert plan.side_m == 120.0
    assert (rows.min(), rows.max()) == (200, 200) and (columns.min(), columns.max()) == (300, 300)
