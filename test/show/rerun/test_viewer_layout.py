"""Sizes of the views in Rerun's layout of the demo's scene, in a small window and in a large one."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import yaml
from made_up_scene import made_up_spec

pytest.importorskip("rerun", reason="Rerun is not installed: pip install -e .[view]")
import rerun.blueprint as rrb
from rerun.blueprint.api import Container
from rerun.blueprint.containers import Horizontal, Tabs

from simbev_ros.config.camera import Camera
from simbev_ros.schema.scene.agents import agent_view
from simbev_ros.show.rerun.blueprint import scene_blueprint
from simbev_ros.show.rerun.subject import Subject

RIG = yaml.safe_load((Path(__file__).parents[3] / "config" / "rigs" / "demo.yaml").read_text())
SENSORS = [{**RIG["defaults"].get(each["type"], {}), **each} for each in RIG["sensors"]]
PANELS_PX, BAR_PX = 65, 28
"""Heights in Chromium of the bars at the top and at the bottom of the window together, and of a title."""
BUTTONS_PX, ICON_PX, LETTER_PX = 84, 34, 7
"""Widths of the buttons next to a title, of the icon and the gaps around it, and of a letter."""


class Room(NamedTuple):
    """A view or tabs, and the room for it."""

    part: Any
    width_px: float
    height_px: float


def rooms(part: Any, width_px: float, height_px: float) -> Iterator[Room]:
    """All views and tabs in a part of the layout, without their titles' heights."""
    if isinstance(part, Tabs):
        yield Room(part, width_px, BAR_PX)
        for tab in part.contents:
            own_px = height_px if isinstance(tab, rrb.View) else height_px - BAR_PX
            yield from rooms(tab, width_px, own_px)
    elif isinstance(part, Container):
        is_row = isinstance(part, Horizontal)
        shares: Any = (part.column_shares if is_row else part.row_shares) or [1.0 for _ in part.contents]
        for each, share in zip(part.contents, shares, strict=True):
            along = share / sum(shares)
            yield from rooms(each, *((width_px * along, height_px) if is_row else (width_px, height_px * along)))
    else:
        yield Room(part, width_px, height_px - BAR_PX)


def layout(width_px: int, height_px: int) -> list[Room]:
    """Rooms for the demo's scene with everything that a layout may show."""
    subject = Subject(agent_view(made_up_spec(SENSORS)))
    blueprint = scene_blueprint(subject, with_predictions=True, is_live=True)
    return list(rooms(blueprint.root_container, width_px, height_px - PANELS_PX))


@pytest.mark.parametrize(("window", "min_height_px"), [((1280, 645), 130), ((1920, 1080), 210)])
def test_pictures_are_large_enough_to_be_read(window: tuple[int, int], min_height_px: int) -> None:
    cameras = {each["name"]: Camera.model_validate(each) for each in SENSORS if each["type"] == "camera"}
    found = [room for room in layout(*window) if str(getattr(room.part, "origin", "")).split("/")[-1] in cameras]
    assert len(found) == len(cameras) * len(SENSORS[0]["modalities"])
    for room in found:
        camera = cameras[room.part.origin.split("/")[-1]]
        assert min(room.height_px, room.width_px * camera.height_px / camera.width_px) >= min_height_px


@pytest.mark.parametrize("window", [(1280, 645), (1920, 1080)])
def test_no_title_is_cut_and_no_view_is_flat(window: tuple[int, int]) -> None:
    for part, width_px, height_px in layout(*window):
        titles = [str(each.name) for each in (part.contents if isinstance(part, Tabs) else [part])]
        needed_px = sum(ICON_PX + LETTER_PX * len(title) for title in titles) + BUTTONS_PX
        assert needed_px <= width_px, titles
        assert isinstance(part, Tabs) or height_px >= 120, titles
