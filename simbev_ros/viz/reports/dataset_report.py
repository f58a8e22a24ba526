"""Builds the report of a dataset: from its ``Statistics`` to one self-contained HTML page."""

from simbev_ros.dataset.statistics import Statistics
from simbev_ros.object_store.object_path import AnyPath, ObjectPath
from simbev_ros.viz.reports import page
from simbev_ros.viz.reports.dataset_boxes import box_figures, crowd_figures, size_figures
from simbev_ros.viz.reports.dataset_ground import cover_figures, grid_figures, map_figures
from simbev_ros.viz.reports.dataset_scenes import key_figures, scene_figures, scene_table, weather_figures
from simbev_ros.viz.reports.page import section, sheet

_STYLE_FILE = "dataset_report.css"


def dataset_report(statistics: Statistics) -> str:
    """The report of a dataset as a self-contained HTML page."""
    up = "The ego is in the middle and faces up; darker: more often."
    sections = [
        section("Scenes", sheet("wide", scene_figures(statistics))),
        section(
            "Boxes",
            sheet("wide", box_figures(statistics)) + sheet("small", crowd_figures(statistics)),
            _sampling_note(statistics),
        ),
        section("Speed and size, class by class", sheet("small", size_figures(statistics))),
        section(
            "Bird's-eye view", sheet("wide", cover_figures(statistics)) + sheet("small", grid_figures(statistics)), up
        ),
        section(
            "Maps",
            sheet("wide", map_figures(statistics)),
            "Paths of the ego, starting at the dot; gray: where other actors were.",
        ),
        section("Weather", sheet("small", weather_figures(statistics)), "At the first frames."),
        section("All scenes", scene_table(statistics)),
    ]
    head = page.key_figures(key_figures(statistics))
    return page.page(_name(statistics.path), head, "".join(sections), _STYLE_FILE)


def _name(dataset: AnyPath) -> str:
    return dataset.name if isinstance(dataset, ObjectPath) else dataset.resolve().name


def _sampling_note(statistics: Statistics) -> str:
    looked_at = statistics.tally.frames
    return "" if statistics.every == 1 else f"Every {statistics.every}th frame was sampled: {looked_at:,} in all."
