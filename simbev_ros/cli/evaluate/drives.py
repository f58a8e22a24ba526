"""``simbev evaluate`` with a dataset alone: the scores of its drives."""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from simbev_ros.cli.console import make_console
from simbev_ros.cli.evaluate import options as option
from simbev_ros.cli.evaluate.tables import print_figure_tables, write_figures
from simbev_ros.foundation.counts import plural
from simbev_ros.foundation.errors import InputError, SimbevError
from simbev_ros.foundation.installation.extras import load_extras
from simbev_ros.recording.layout import PARTIAL_SUFFIX

if TYPE_CHECKING:
    from simbev_ros.dataset import Dataset, Scene
    from simbev_ros.evaluation.driving.recorded_drives import RecordedDrive
    from simbev_ros.evaluation.tables import FigureTable


def evaluate_drives(
    dataset: Path, split: str | None, scenes: str | None, report: Path | None, json_file: Path | None
) -> None:
    """Print the scores of the drives of a dataset or a bag, and write them to the files that are asked for.

    Raises:
        InputError: No scene has a drive.
        BagError: A bag is damaged.
    """
    from simbev_ros.evaluation.driving.figures import drives_figures
    from simbev_ros.evaluation.driving.recorded_drives import drives_of

    with make_console(stderr=True).status("drives"):
        opened, unfinished = _opened(dataset)
        chosen = option.chosen_scenes(opened, split, scenes)
        drives = drives_of(chosen)
    if not drives:
        raise InputError(
            f"{dataset}: no scene has a route to drive (section drive); predictions come before the dataset"
        )
    words = [plural(len(drives), "drive")]
    if cut := [each.scene for each in drives if each.scene in unfinished]:
        words.append(f"scored up to their last tick, as their scenes failed: {', '.join(cut)}")
    figures = {"dataset": str(dataset), **drives_figures({each.scene: each.record() for each in drives})}
    show_drives(dataset.resolve().name, words, chosen, drives, figures, report=report, json_file=json_file)


def show_drives(
    title: str,
    words: "Sequence[str]",
    scenes: "Sequence[Scene]",
    drives: "Sequence[RecordedDrive]",
    figures: "Mapping[str, Any]",
    tables: "Iterable[FigureTable]" = (),
    *,
    report: Path | None,
    json_file: Path | None,
) -> None:
    """Print words and the scores of drives with further tables; write a report and figures if they are asked for."""
    from simbev_ros.evaluation.driving.tables import drive_tables

    console = make_console(highlight=False)
    if json_file is not None:
        write_figures(json_file, figures, console)
    for line in words:
        console.print(line, soft_wrap=True)
    print_figure_tables([*drive_tables(drives, figures), *tables], console)
    if report is not None:
        from simbev_ros.show.reports.drive_report import write_drive_report

        with make_console(stderr=True).status("report"):
            write_drive_report(report, title, scenes, drives, figures)
        console.print(f"report in {report}", soft_wrap=True)


def drives_beside(chosen: "Sequence[Scene]", console: Console) -> "tuple[dict[str, Any], list[FigureTable]]":
    """Figures and tables of the drives of scenes with predictions; empty if no scene has a drive.

    A line says so if the simulator's libraries, which judge drives, are not installed.

    Raises:
        BagError: A bag is damaged.
    """
    if all(scene.spec.drive is None for scene in chosen):
        return {}, []
    if load_extras()["sim"].missing:
        console.print(load_extras()["sim"].remedy("the score of drives"), soft_wrap=True)
        return {}, []
    from simbev_ros.evaluation.driving.figures import drives_figures
    from simbev_ros.evaluation.driving.recorded_drives import drives_of
    from simbev_ros.evaluation.driving.tables import drive_tables

    drives = drives_of(chosen)
    figures = drives_figures({each.scene: each.record() for each in drives})
    return {"drives": figures}, [*drive_tables(drives, figures)]


def _opened(path: Path) -> "tuple[Dataset, frozenset[str]]":
    """A dataset with the scenes that failed as well, and their names; their drives have scores, too."""
    from simbev_ros.dataset import Dataset, open_dataset

    opened = open_dataset(path, threads=1)
    scenes = {scene.name: scene for scene in opened.scenes}
    finished = {*scenes}
    for bag in sorted(path.glob(f"scenes/*/*{PARTIAL_SUFFIX}")):
        with suppress(SimbevError):
            scene = open_dataset(bag, threads=1).scenes[0]
            scenes.setdefault(scene.name, scene)
    return Dataset(opened.path, [*scenes.values()]), frozenset(scenes.keys() - finished)
