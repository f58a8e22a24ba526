"""``simbev replay``: a recorded scene once more, with other sensors, another weather or another time of day."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from simbev_ros.config.load import load_scenario


def replay(
    bag: Annotated[Path, typer.Argument(help="A scene's bag: its folder or its .mcap file.")],
    config: Annotated[str, typer.Argument(help="Configuration file: rig, annotation, weather.", show_default=False)],
    record: Annotated[
        Path | None, typer.Option("--record", "--out", help="Record the scene as a bag in this dataset folder.")
    ] = None,
    live: Annotated[bool, typer.Option("--live", help="In real time; sensor topics are best effort.")] = False,
) -> None:
    """Play a recorded scene with exactly the same motion, on the same topics and stamps.

    Rig and annotation are the configuration's, and weather and lights if it has these sections; all else is the bag's.

    [bold]Examples[/]

    simbev replay out/demo/scenes/train/Blocks-0000 night.yaml --record datasets/night
    """
    from simbev_ros.cli.scenes import map_roads, play_specs
    from simbev_ros.recording.reader import SceneBag
    from simbev_ros.recording.replay import Replay, load_recorded_roads, recorded_spec, replayed_spec

    scenario = load_scenario(config)
    console = Console()
    with SceneBag(bag) as recorded:
        load_recorded_roads(recorded)
        network = map_roads(recorded_spec(recorded).map, console)
        spec = replayed_spec(recorded, scenario, network)
    Replay(spec, bag).close()  # whatever is wrong with the bag is said before the graph starts
    for path in play_specs(scenario, [spec], console, live=live, dataset=record, replay=bag):
        console.print(f"recorded {path}", soft_wrap=True)
