"""Builds the report of drives: their scores, and each infraction with pictures from above."""

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from simbev_ros.dataset import Frame, Scene
from simbev_ros.evaluation.driving.infractions import Infraction
from simbev_ros.evaluation.driving.recorded_drives import RecordedDrive
from simbev_ros.evaluation.driving.tables import described, drive_tables
from simbev_ros.evaluation.tables import text_of
from simbev_ros.foundation.files.whole_files import write_errors, write_whole
from simbev_ros.foundation.types import Table
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.schema.boxes import blank_boxes, box_centers_m
from simbev_ros.schema.scene.state import EGO_ID
from simbev_ros.show.pages.web_page import web_page
from simbev_ros.show.reports.evaluation_pictures import MarkedBoxes, top_view
from simbev_ros.show.reports.evaluation_tables import html_table
from simbev_ros.show.reports.page import key_figures, section, sheet

_HALF_EXTENT_M = 30.0
_STRIP_S = (-2, -1, 0, 1)
"""Times of a strip's pictures after the infraction."""
_KINDS = {"answer": "the ego", "missed": "the other party", "found": "other actors"}
_NOTE = (
    "Scores by the definitions of CARLA's leaderboards 2.0 and 2.1, Bench2Drive and nuPlan (in percent). CARLA counts "
    "collisions in motion regardless of fault; nuPlan counts those at fault."
)
_HEADS = {"CARLA 2.0": ("leaderboard_2_0", "driving_score"), "CARLA 2.1": ("leaderboard_2_1", "driving_score")}


def write_drive_report(
    path: Path, title: str, scenes: Sequence[Scene], drives: Sequence[RecordedDrive], means: Mapping[str, Any]
) -> None:
    """Write the page.

    Args:
        path: The HTML file.
        title: Title of the page.
        scenes: Scenes, with those of the drives among them.
        drives: The drives.
        means: Their means, see ``evaluation.driving.figures.mean_figures``.

    Raises:
        InputError: The file cannot be written.
    """
    by_name = {scene.name: scene for scene in scenes}
    head = key_figures([(text_of(means["scores"][score].get(key)), name) for name, (score, key) in _HEADS.items()])
    scores, *counts = (html_table(table) for table in drive_tables(drives, means))
    legend = "".join(f'<span><i class="{kind}"></i>{caption}</span>' for kind, caption in _KINDS.items())
    cards = "".join(_cards(by_name[drive.scene], drive) for drive in drives)
    pictures = f'<p class="legend">{legend}</p>{cards}' if cards else ""
    body = section("Scores", scores, _NOTE) + section("Infractions", "".join(counts) + pictures)
    with write_errors(path):
        write_whole(path, web_page(title, head, body, []).encode())


def _cards(scene: Scene, drive: RecordedDrive) -> str:
    """HTML of the infractions of a drive, with a strip of pictures for each."""
    if not drive.infractions:
        return ""
    strips = "".join(f"<p>{_caption(scene, each)}</p>{_strip(scene, each)}" for each in drive.infractions)
    return f"<article><h3>{escape(scene.name)}</h3>{strips}</article>"


def _caption(scene: Scene, infraction: Infraction) -> str:
    time_s = (infraction.stamp_ns - int(scene.stamps_ns[0])) / NS_PER_S
    x_m, y_m, _ = infraction.position_m
    parts = [f"{time_s:.2f} s (tick {infraction.tick})", f"x {x_m:.1f} m, y {y_m:.1f} m"]
    parts += [f"{infraction.speed_mps:.1f} m/s", *([f"with {infraction.other}"] if infraction.other else [])]
    parts += [] if infraction.at_fault else ["not at fault"]
    what = escape(described(infraction.kind, infraction.value))
    return f"<b>{what}</b>: {escape(', '.join(parts))}"


def _strip(scene: Scene, infraction: Infraction) -> str:
    """HTML of the pictures around an infraction."""
    labeled = np.flatnonzero(scene.has(["bev/labels"])) if "bev/labels" in scene.keys else np.empty(0, np.int64)
    figures = []
    for after_s in _STRIP_S:
        stamp_ns = infraction.stamp_ns + after_s * NS_PER_S
        if not scene.stamps_ns[0] <= stamp_ns <= scene.stamps_ns[-1]:
            continue
        tick = int(np.searchsorted(scene.stamps_ns, stamp_ns))
        frame = scene[tick]
        ground = scene[int(labeled[np.abs(labeled - tick).argmin()])] if len(labeled) else None
        picture = top_view(frame, _marked(frame, infraction.other), _HALF_EXTENT_M, ground)
        when = "now" if after_s == 0 else f"{abs(after_s)} s {'before' if after_s < 0 else 'after'}"
        figures.append(f"<figure>{picture}<figcaption>{when}</figcaption></figure>")
    return sheet("small", figures)


def _marked(frame: Frame, other: str) -> Iterator[MarkedBoxes]:
    """Boxes of the actors near the ego, from their true states; the ego and the other party stand out."""
    actors = frame["world/actors"]
    ego = actors[actors["id"] == EGO_ID]
    near = np.hypot(actors["x"] - ego["x"], actors["y"] - ego["y"]) < 1.5 * _HALF_EXTENT_M
    is_other, is_ego = actors["id"].astype(str) == other, actors["id"] == EGO_ID
    for kind, chosen in (("found", near & ~is_other & ~is_ego), ("missed", is_other), ("answer", is_ego)):
        yield MarkedBoxes(kind, _boxes(actors[chosen]), [f"actor {each}" for each in actors["id"][chosen].tolist()])


def _boxes(actors: Table) -> Table:
    boxes = blank_boxes(len(actors))
    for name, values in zip("xyz", box_centers_m(actors).T, strict=True):
        boxes[name] = values
    for name in ("roll", "pitch", "yaw", "length", "width", "height"):
        boxes[name] = actors[name]
    return boxes
