"""``simbev replay``: plays recorded scenes with other sensors, other weather or another time of day."""

from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from rich.console import Console

from simbev_ros.cli.console import make_console
from simbev_ros.cli.evaluate.live import FiguresOption, StackOption, with_evaluation
from simbev_ros.cli.generate import show_failures
from simbev_ros.cli.pool import MAX_GRAPHS, worker_count
from simbev_ros.cli.ros_options import NamespaceOption, ros_arguments
from simbev_ros.cli.scene_options import Config, GraphRay, GraphWorkers, Live
from simbev_ros.config.load import load_scenario
from simbev_ros.foundation.counts import plural
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.whole_files import require_writable
from simbev_ros.recording.layout import additional_folder
from simbev_ros.ros.conventions.arguments import RosArguments

if TYPE_CHECKING:
    from simbev_ros.config.scenario import Scenario
    from simbev_ros.production.replay.replays import ReplayResult


Bags = Annotated[list[Path], typer.Argument(help="Scenes' bags, their .mcap files, or datasets.", show_default=False)]
Out = Annotated[Path | None, typer.Option(help="Record the scenes as bags in this dataset folder.")]
Merge = Annotated[
    str | None,
    typer.Option(help="Record each scene as an additional bag next to its own, <scene>.LABEL.", metavar="LABEL"),
]


def replay(
    context: typer.Context,
    bags: Bags,
    config: Config,
    out: Out = None,
    merge: Merge = None,
    workers: GraphWorkers = None,
    ray: GraphRay = None,
    live: Live = False,
    namespace: NamespaceOption = None,
    evaluate: FiguresOption = None,
    stack: StackOption = None,
) -> None:
    """Play recorded scenes with exactly the same motion, on the same topics and stamps.

    Rigs and annotation come from the configuration, as do weather and lights if it has these sections; everything else
    comes from the bags. Agents ride in the vehicles that carried them, by name; a new one names its carrier or has a
    mast. Of a dataset only scenes that are not recorded yet are played: after Ctrl-C the same command continues where
    it stopped.

    With --workers or --ray, a scene that fails is retried, then listed, and the others follow; the exit code is 1
    then. Each attempt has a log.

    [bold]Examples[/]

    simbev replay out/demo/scenes/train/Blocks-0000 night.yaml --out datasets/night

    simbev replay datasets/first rear_cameras.yaml --merge rear

    simbev replay datasets/first night.yaml --out datasets/night --workers auto

    simbev replay /shared/datasets/first rear_cameras.yaml --merge rear --ray auto
    """
    if merge is not None and (out is not None or live):
        raise InputError("--merge records next to the replayed bags; give neither --out nor --live with it")
    ros, count = ros_arguments(context, namespace), worker_count(workers, MAX_GRAPHS)
    if workers is None and ray is None:
        scenario = with_evaluation(load_scenario(config).for_replay(), evaluate, stack or ())
        _play(bags, scenario, out, merge, live=live, ros=ros)
        return
    one_graph = {"--live": live, "--evaluate": evaluate is not None, "--stack": bool(stack)}
    one_graph |= {"--namespace": namespace is not None, "--ros-args": bool(context.obj)}
    _require_recording([option for option, is_given in one_graph.items() if is_given], out, merge)
    result = _record(bags, load_scenario(config), out, merge, count, ray)
    raise typer.Exit(0 if result.is_complete else 1)


def _record(
    bags: Sequence[Path],
    scenario: "Scenario",
    out: Path | None,
    merge: str | None,
    workers: int | Literal["auto"] | None,
    ray: str | None,
) -> "ReplayResult":
    """Record scenes on several graphs at once, and print what became of them."""
    from simbev_ros.cli.production_display import DatasetDisplay
    from simbev_ros.production.replay.replays import replay_bags

    console = make_console()
    display = DatasetDisplay(console)
    result = replay_bags(scenario, bags, out=out, merge=merge, workers=workers, ray=ray, observer=display)
    _show(result, console)
    return result


def _play(
    bags: Sequence[Path],
    scenario: "Scenario",
    record: Path | None,
    merge: str | None,
    *,
    live: bool,
    ros: RosArguments,
) -> None:
    """Play scenes one after the other on one graph, with or without recording."""
    from simbev_ros.cli.production_display import SceneDisplay
    from simbev_ros.production.play import play_specs
    from simbev_ros.production.replay.entry import checked_scene, require_distinct
    from simbev_ros.production.replay.selection import folder_of, select_bags
    from simbev_ros.production.replay.target import lock_replay_target

    console = make_console()
    if record is not None:
        require_writable(record)
    selection = select_bags(bags, record, merge)
    _show_recorded_before(selection.recorded, console)
    if not selection.bags:
        return
    folders = [folder_of(bag) for bag in selection.bags]
    display = SceneDisplay(console)
    with lock_replay_target(record, folders, merge) as dataset:
        specs = [checked_scene(bag, scenario, display) for bag in selection.bags]
        if dataset is not None:
            require_distinct(specs)
        options: dict[str, Any] = {"live": live, "dataset": dataset, "ros": ros, "replays": selection.bags}
        playing = play_specs(scenario, specs, **options, observer=display)
        with closing(playing) as scenes:
            for folder, recorded in zip(folders, scenes, strict=True):
                bag = recorded if merge is None else recorded.rename(additional_folder(folder, merge))
                if dataset is not None:
                    console.print(f"recorded {bag}", highlight=False, soft_wrap=True)


def _require_recording(of_one_graph: Sequence[str], record: Path | None, merge: str | None) -> None:
    """Check that workers would record scenes, and do nothing else.

    Args:
        of_one_graph: Options that were given and that several graphs cannot serve.
        record: Dataset to record into.
        merge: Label of additional bags.

    Raises:
        InputError: They would not.
    """
    if of_one_graph:
        raise InputError(f"{of_one_graph[0]}: is for one graph; give neither --workers nor --ray with it")
    if record is None and merge is None:
        raise InputError("--workers and --ray record scenes; give --out or --merge with them")


def _show_recorded_before(bags: Sequence[Path], console: Console) -> None:
    if bags:
        console.print(f"{plural(len(bags), 'scene')} recorded before", highlight=False)


def _show(result: "ReplayResult", console: Console) -> None:
    """Print the bags that workers have recorded, and a table of the scenes that failed."""
    _show_recorded_before(result.existing, console)
    for bag in result.recorded:
        console.print(f"recorded {bag}", highlight=False, soft_wrap=True)
    show_failures(result.failed, console)
