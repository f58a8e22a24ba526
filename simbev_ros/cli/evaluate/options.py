"""Options of ``simbev evaluate``, and what they choose."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from pydantic import ValidationError

from simbev_ros.cli.agent_option import require_agent
from simbev_ros.config.evaluation import RINGS_M, Evaluation, answer_topics_of
from simbev_ros.config.evaluation_file import load_evaluation
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.semantics import PAPER_CLASSES

if TYPE_CHECKING:
    from simbev_ros.dataset import Dataset, Scene

_WORDS = "with commas between"
_OF_SECTION = {
    "truth": "truth",
    "min_range_m": "range",
    "range_m": "range",
    "min_points": "points",
    "classes": "classes",
    "by": "by",
    "rings_m": "by",
}
"""Options by the fields of the section that they replace."""
_SHOWN_NAMES = 10

Predictions = Annotated[
    Path,
    typer.Argument(
        help="A Parquet, NPZ or MCAP file, a bag, or a folder of them; left out: drives are scored.", show_default=False
    ),
]
DatasetArgument = Annotated[Path | None, typer.Argument(help="The dataset, or one scene's bag.", show_default=False)]
Config = Annotated[
    str | None,
    typer.Option(help="Configuration file; its section evaluation says what counts, and options replace its fields."),
]
Split = Annotated[Literal["train", "val", "test"] | None, typer.Option(help="Only scenes of this split.")]
Scenes = Annotated[str | None, typer.Option(help=f"Only these scenes, {_WORDS}.", metavar="NAMES")]
TruthOption = Annotated[
    Literal["own", "joint"] | None,
    typer.Option(help="Boxes to find: the agent's own, or with the points and the visibility of all agents together."),
]
Range = Annotated[
    str | None, typer.Option("--range", help="Distance range from the ego vehicle, in meters.", metavar="FROM:TO")
]
MinPoints = Annotated[
    int | None, typer.Option("--points", help="Minimum number of lidar and radar points in a box.", min=0)
]
Classes = Annotated[
    str | None,
    typer.Option(
        help=f"Only these classes of boxes and cells, {_WORDS}; default: the paper's, {', '.join(PAPER_CLASSES)}.",
        metavar="NAMES",
    ),
]
Everything = Annotated[
    bool, typer.Option("--all", help="All classes, and also boxes that no sensor sees; other options restrict them.")
]
By = Annotated[
    str | None,
    typer.Option(
        help=f"Tables by distance, visibility, points, difficulty, daytime, weather, map, {_WORDS}; default: distance, "
        f"in rings that begin at {', '.join(f'{start:g}' for start in RINGS_M)} m. distance:20,40 has its own limits.",
        metavar="NAMES",
    ),
]
Every = Annotated[int, typer.Option(help="Evaluate every Nth frame of each scene.", min=1)]
NuScenes = Annotated[
    bool, typer.Option("--nuscenes", help="Also compute the metrics of nuScenes, over its keyframes and classes.")
]
Report = Annotated[Path | None, typer.Option(help="HTML file with curves, tables and the worst frames.")]
JsonFile = Annotated[Path | None, typer.Option("--json", help="File for all figures.")]


def chosen_section(
    config: str | None,
    truth: str | None,
    distance: str | None,
    points: int | None,
    classes: str | None,
    by: str | None,
    *,
    everything: bool = False,
) -> Evaluation:
    """The section of the configuration, or the defaults, with the values of the options that are given.

    ``everything`` is ``--all``: what it adds to what counts comes before the other options.

    Raises:
        InputError: The configuration or an option is wrong.
    """
    section = Evaluation(by=("distance",)) if config is None else load_evaluation(config)
    given: dict[str, Any] = {"truth": truth, "min_points": points}
    if distance is not None:
        given["min_range_m"], given["range_m"] = _span("--range", distance)
    given["classes"] = _words("--classes", classes) if classes is not None else "all" if everything else None
    given["seen"] = False if everything else None
    given["by"], given["rings_m"] = (None, None) if by is None else _groups(by) if by else ((), None)
    return _with_options(section, {name: value for name, value in given.items() if value is not None})


def _with_options(section: Evaluation, given: Mapping[str, Any]) -> Evaluation:
    try:
        return Evaluation.model_validate({**section.model_dump(exclude_unset=True), **given})
    except ValidationError as error:
        entry = error.errors()[0]
        field = str(entry["loc"][0]) if entry["loc"] else "range_m"
        value = "" if entry["type"] == "value_error" else f", not {entry['input']!r}"
        problem = entry["msg"].removeprefix("Value error, ") + value
        raise InputError(problem, parameter=_OF_SECTION[field]) from None


def _words(option: str, text: str) -> tuple[str, ...]:
    """Words that are separated by commas."""
    found = tuple(word.strip() for word in text.split(","))
    if not all(found):
        raise InputError(f"{option}: {text!r}: must be words with commas between")
    return found


def _groups(text: str) -> tuple[tuple[str, ...], tuple[float, ...] | None]:
    """Conditions of tables, and the starts of rings if ``distance:20,40`` gives the limits between them."""
    names, rings_m = list[str](), list[float]()
    for word in _words("--by", text):
        name, colon, limit = word.partition(":")
        if colon and name == "distance":
            names.append(name)
            rings_m = [0.0, _number("--by", limit)]
        elif rings_m and names[-1] == "distance" and word[:1].isdigit():
            rings_m.append(_number("--by", word))
        else:
            names.append(word)
    return tuple(names), tuple(rings_m) or None


def _span(option: str, text: str) -> tuple[float, float | None]:
    """The ends of ``FROM:TO``, which by default begins at 0 and has no end."""
    low, colon, high = text.partition(":")
    if not colon:
        raise InputError(f"{option}: {text!r}: must be FROM:TO, as 0:50 or 20:")
    return _number(option, low) if low else 0.0, _number(option, high) if high else None


def _number(option: str, word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{option}: {word!r} is not a number")
    return value


def chosen_scenes(
    dataset: "Dataset", split: str | None, names: str | None, agent: str | None = None
) -> Sequence["Scene"]:
    """The scenes of a dataset with a split, names and an agent, as it sees them; None: any, as the first agent.

    Raises:
        InputError: A scene does not exist, or none is left.
    """
    wanted = None if names is None else _words("--scenes", names)
    known = [scene.name for scene in dataset.scenes]
    for name in wanted or ():
        if name not in known:
            shown = ", ".join(known[:_SHOWN_NAMES]) or "none"
            raise InputError(f"--scenes: {dataset.path} has no scene {name!r}, but {shown}")
    scenes = [s for s in dataset.scenes if split in (None, s.split) and (wanted is None or s.name in wanted)]
    if not scenes:
        of_split = "" if split is None else f" of the split {split!r}"
        raise InputError(f"{dataset.path}: there is no scene{of_split} to evaluate")
    if agent is None:
        return scenes
    require_agent(agent, sorted({name for scene in scenes for name in scene.agents}), dataset.path)
    return [scene.of_agent(agent) for scene in scenes if agent in scene.agents]


def answer_topics(section: Evaluation, scenes: Sequence["Scene"], agent: str | None) -> tuple[str, str]:
    """Topics of boxes and of grids: those of the section, or else the usual ones of an agent (None: the first one)."""
    is_first = agent is None or all(scene.view.is_ego for scene in scenes)
    boxes_topic, grids_topic = answer_topics_of("" if is_first else str(agent))
    set_fields = section.model_fields_set
    return (
        section.boxes_topic if "boxes_topic" in set_fields else boxes_topic,
        section.grids_topic if "grids_topic" in set_fields else grids_topic,
    )
