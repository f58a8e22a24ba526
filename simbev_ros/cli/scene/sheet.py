"""Writes the page of drawn scenes for ``simbev scene --out``."""

from pathlib import Path

from simbev_ros.cli.console import counting_bar, make_console
from simbev_ros.cli.output_file import require_place
from simbev_ros.cli.scene.report import numbered_scenes
from simbev_ros.config.load import load_scenario
from simbev_ros.dataset.parallel import Pool
from simbev_ros.foundation.counts import plural
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.whole_files import write_errors, write_whole
from simbev_ros.show.pages.drawn_scenes import (
    MAX_SCENES,
    DrawnScene,
    PlannedDrawing,
    draw_scene_with_map,
    drawn_scenes_page,
)


def write_sheet(config: str, count: int | None, map_name: str | None, out: Path, pool: Pool) -> None:
    """Draw the scenes of a configuration and write a page with a small map and the parameters of each.

    Args:
        config: Configuration file, or the name of a built-in one.
        count: Number of scenes; that of the configuration when None. After the last one they are repeated.
        map_name: Town or map file for all scenes, in place of the configuration's.
        out: The page.
        pool: Workers that draw.

    Raises:
        InputError: The configuration is invalid, there are too many scenes, or the page cannot be written.
    """
    require_place(out)
    scenario = load_scenario(config)
    planned = numbered_scenes(scenario, count, map_name)
    if len(planned) > MAX_SCENES:
        raise InputError(f"--count: is {len(planned)}; allowed with --out: 1 to {MAX_SCENES}")
    console, by_map = make_console(stderr=True, soft_wrap=True), sorted(planned, key=lambda each: each.map.name)
    drawn = list[DrawnScene]()
    with counting_bar("scenes", console, len(planned)) as bar:
        for scene in pool.map(draw_scene_with_map, [PlannedDrawing(scenario, each) for each in by_map]):
            drawn.append(scene)
            bar.advance()
    page = drawn_scenes_page(Path(config).stem, sorted(drawn, key=lambda scene: scene.spec.number))
    with write_errors(out):
        write_whole(out, page.encode())
    console.print(f"{plural(len(drawn), 'scene')} in {out}", highlight=False)
