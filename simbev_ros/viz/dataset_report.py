"""A dataset's statistics as one page, HTML, that needs nothing beside itself."""

from collections.abc import Iterable
from html import escape
from importlib.resources import files

from simbev_ros import __version__
from simbev_ros.dataset.statistics import Statistics
from simbev_ros.viz.report_boxes import box_figures, crowd_figures, size_figures
from simbev_ros.viz.report_ground import cover_figures, grid_figures, map_figures
from simbev_ros.viz.report_scenes import key_figures, scene_figures, scene_table, weather_figures

_STYLE_FILE = "dataset_report.css"


def dataset_report(statistics: Statistics) -> str:
    """The page."""
    name = escape(statistics.path.resolve().name)
    figures = "".join(f"<div><b>{value}</b><span>{what}</span></div>" for value, what in key_figures(statistics))
    style = files("simbev_ros.viz").joinpath(_STYLE_FILE).read_text(encoding="utf-8")
    up = "The ego is in the middle and looks up; darker: more often."
    sections = [
        _section("Scenes", _sheet("wide", scene_figures(statistics))),
        _section(
            "Boxes",
            _sheet("wide", box_figures(statistics)) + _sheet("small", crowd_figures(statistics)),
            _sampling(statistics),
        ),
        _section("Speed and size, class by class", _sheet("small", size_figures(statistics))),
        _section(
            "Bird's-eye view", _sheet("wide", cover_figures(statistics)) + _sheet("small", grid_figures(statistics)), up
        ),
        _section(
            "Maps",
            _sheet("wide", map_figures(statistics)),
            "Ways of the ego, from the dot on; grey: where others were.",
        ),
        _section("Weather", _sheet("small", weather_figures(statistics)), "At the first frames."),
        _section("All scenes", scene_table(statistics)),
    ]
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{name}</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<style>{style}</style></head><body><header><h1>{name}</h1>"
        f'<div class="key">{figures}</div></header><main>{"".join(sections)}</main>'
        f"<footer>simbev_ros {escape(__version__)}</footer></body></html>"
    )


def _section(title: str, body: str, note: str = "") -> str:
    """Nothing if there is nothing in it."""
    said = f'<p class="lead">{escape(note)}</p>' if note else ""
    return f"<section><h2>{escape(title)}</h2>{said}{body}</section>" if body else ""


def _sheet(kind: str, figures: Iterable[str]) -> str:
    """Wide or small figures beside each other."""
    body = "".join(figures)
    return f'<div class="{kind}">{body}</div>' if body else ""


def _sampling(statistics: Statistics) -> str:
    looked_at = statistics.tally.frames
    return "" if statistics.every == 1 else f"Each {statistics.every}th frame was looked at: {looked_at:,} in all."
