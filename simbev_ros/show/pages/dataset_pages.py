"""Writes the pages of a dataset: one with a table of its scenes and its statistics, and one for each scene.

A dataset's ``Statistics`` enter; a page and a folder next to it leave. They load nothing from elsewhere, and can be
opened from the disk or served by any web server.
"""

from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from urllib.parse import quote

from simbev_ros.dataset import open_dataset
from simbev_ros.dataset.parallel import Pool
from simbev_ros.dataset.statistics import SceneFacts, Statistics
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.whole_files import require_replaceable, require_writable, write_whole
from simbev_ros.foundation.object_store.object_path import AnyPath, ObjectPath
from simbev_ros.show.pages.box_figures import box_figures, crowd_figures, size_figures
from simbev_ros.show.pages.browsable_table import Cell, Column, browsable_table
from simbev_ros.show.pages.ground_figures import cover_figures, grid_figures, map_figures, square_of_map
from simbev_ros.show.pages.scene_columns import CONDITIONS, condition_cells, hazard_cell
from simbev_ros.show.pages.scene_figures import key_figures, scene_figures, weather_figures
from simbev_ros.show.pages.scene_media import THUMBNAIL, THUMBNAIL_SIZE
from simbev_ros.show.pages.scene_page import PAGE, PlanPicture, ScenePage, write_plan, write_scene_page
from simbev_ros.show.pages.web_page import plotly_script, web_page
from simbev_ros.show.reports import page as sections
from simbev_ros.show.reports.page import section, sheet

_PLOTLY, _SCENES, _MAPS = "plotly.min.js", "scenes", "maps"
_COLUMNS = (
    Column("", None, "picture"),
    Column("scene", "text"),
    Column("map", "choice"),
    Column("split", "choice"),
    *CONDITIONS,
    Column("vehicles", "range", is_number=True),
    Column("pedestrians", "range", is_number=True),
    Column("hazards", "choice"),
    Column("collisions", "range", is_number=True),
    Column("s", "range", "duration in seconds", is_number=True),
    Column("boxes", None, "boxes a frame", is_number=True),
    Column("ego m", None, "length of the ego's path", is_number=True),
    Column("MB", None, "size of the bag", is_number=True),
)


def files_of(page: Path) -> Path:
    """The folder next to a dataset's page that holds all other files."""
    return page.with_name(f"{page.stem}_files")


def require_files_folder(page: Path) -> None:
    """Check that the folder of a page's other files can be written.

    Raises:
        DiskError: The disk is full.
        InputError: It cannot, there is a file in its place, or there is a link in it, which may lead anywhere.
    """
    folder = files_of(page)
    for file in (folder, *folder.rglob("*")):
        require_replaceable(file)
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file; the pages need a folder of this name")
    require_writable(folder)


def write_pages(
    statistics: Statistics, page: Path, pool: Pool, progress: Callable[[int, int], None], *, videos: bool = True
) -> None:
    """Write the page of a dataset, and those of its scenes. Pictures and videos newer than their bags are kept.

    Args:
        statistics: Statistics of the dataset.
        page: The page; the other files are in the folder ``files_of(page)``.
        pool: Workers that write the scenes' pages.
        progress: Called with the number of parts written so far and the number of all parts.
        videos: Whether scenes get videos.

    Raises:
        BagError: A bag is damaged.
        InputError: See ``require_files_folder``.
        OSError: A file cannot be written.
    """
    require_files_folder(page)
    folder = files_of(page)
    plans, scenes = _plans(statistics, folder), _scene_pages(statistics, page, videos=videos)
    total = len(plans) + len(scenes)
    has_plan = [_counted(ok, done, total, progress) for done, ok in enumerate(pool.map(write_plan, plans), 1)]
    has_pictures = [
        _counted(ok, done, total, progress)
        for done, ok in enumerate(pool.map(write_scene_page, scenes), 1 + len(plans))
    ]
    write_whole(folder / _PLOTLY, plotly_script().encode())
    drawn = {
        plan.file.stem: f"{folder.name}/{_MAPS}/{plan.file.name}"
        for plan, ok in zip(plans, has_plan, strict=True)
        if ok
    }
    pictured = {work.facts.name for work, ok in zip(scenes, has_pictures, strict=True) if ok}
    write_whole(page, dataset_page(statistics, folder.name, drawn, pictured).encode())


def dataset_page(statistics: Statistics, folder: str, plans: Mapping[str, str], pictured: Collection[str]) -> str:
    """HTML of the page of a dataset.

    Args:
        statistics: Statistics of the dataset.
        folder: Name of the folder with the other files.
        plans: Addresses of the maps' pictures, by the map's name.
        pictured: Names of the scenes that have pictures.
    """
    up = "The ego is in the middle and faces up; darker: more often."
    table = browsable_table("Scenes", _COLUMNS, [_row(scene, folder, pictured) for scene in statistics.scenes])
    parts = [
        section("Scenes", table),
        section("Scenes and traffic", sheet("wide", scene_figures(statistics))),
        section("Maps", sheet("pair", map_figures(statistics, plans)), "Paths of the ego, each starting at a dot."),
        section(
            "Boxes",
            sheet("wide", box_figures(statistics)) + sheet("small", crowd_figures(statistics)),
            _sampling_note(statistics),
        ),
        section("Speed and size, class by class", sheet("small", size_figures(statistics))),
        section(
            "Bird's-eye view", sheet("wide", cover_figures(statistics)) + sheet("small", grid_figures(statistics)), up
        ),
        section("Weather", sheet("small", weather_figures(statistics)), "At the first frames."),
    ]
    head = sections.key_figures(key_figures(statistics))
    plotly = f"{quote(folder)}/{_PLOTLY}"
    return web_page(_name(statistics.path), head, "".join(parts), ("browse.js", "charts.js"), plotly)


def _row(scene: SceneFacts, folder: str, pictured: Collection[str]) -> list[Cell]:
    """Cells of a scene in the order of ``_COLUMNS``."""
    place = f"{quote(folder)}/{_SCENES}/{quote(scene.name)}"
    name = Cell(scene.name)
    link = f'<a href="{place}/{PAGE}">{name.shown}</a>'
    width, height = THUMBNAIL_SIZE
    alt = f'alt="Front view of {name.shown}"'
    picture = f'<img src="{place}/{THUMBNAIL}" {alt} width="{width}" height="{height}" loading="lazy">'
    return [
        Cell("", picture if scene.name in pictured else ""),
        Cell(scene.name, link),
        Cell(scene.map),
        Cell(scene.split),
        *condition_cells(scene.weather),
        Cell(scene.vehicles),
        Cell(scene.pedestrians),
        hazard_cell(scene.hazards),
        Cell(scene.collisions),
        Cell(round(scene.duration_s, 2)),
        Cell(round(scene.boxes / max(scene.labeled_frames, 1), 1)),
        Cell(round(scene.distance_m)),
        Cell(round(scene.file_bytes / 1e6, 1)),
    ]


def _plans(statistics: Statistics, folder: Path) -> list[PlanPicture]:
    """The pictures of the maps; their roads come from the bag of a scene on each."""
    bags = {scene.map: scene.path for scene in open_dataset(statistics.path, threads=1).scenes}
    squares = {name: square_of_map(statistics, name) for name in statistics.visited}
    return [
        PlanPicture(statistics.path, bags[name], square, folder / _MAPS / f"{name}.jpg")
        for name, square in squares.items()
        if square is not None
    ]


def _scene_pages(statistics: Statistics, page: Path, *, videos: bool) -> list[ScenePage]:
    """The pages of the scenes, ordered by map, as workers keep the roads of one map."""
    bags = {scene.name: scene.path for scene in open_dataset(statistics.path, threads=1).scenes}
    names = ["", *(scene.name for scene in statistics.scenes), ""]
    home = f"../../../{page.name}"
    pages = [
        ScenePage(
            statistics.path,
            bags[scene.name],
            scene,
            files_of(page) / _SCENES / scene.name,
            home,
            f"../../{_PLOTLY}",
            before,
            after,
            videos,
        )
        for before, scene, after in zip(names, statistics.scenes, names[2:], strict=False)
    ]
    return sorted(pages, key=lambda work: work.facts.map)


def _counted(result: bool, done: int, total: int, progress: Callable[[int, int], None]) -> bool:
    progress(done, total)
    return result


def _name(dataset: AnyPath) -> str:
    return dataset.name if isinstance(dataset, ObjectPath) else dataset.resolve().name


def _sampling_note(statistics: Statistics) -> str:
    looked_at = statistics.tally.frames
    return "" if statistics.every == 1 else f"Every {statistics.every}th frame was sampled: {looked_at:,} in all."
