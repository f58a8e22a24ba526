"""``python -m tools.bench endurance``: watches what a graph holds during long runs."""

from typing import Annotated

import typer

from simbev_ros.cli.console import make_console
from simbev_ros.cli.timing_report import Json, show_timing
from simbev_ros.foundation.errors import InputError


def endurance(
    minutes: Annotated[int, typer.Option(help="Duration of the live run; 0: none.", min=0, max=50)] = 30,
    scenes: Annotated[
        int, typer.Option(help="Number of short scenes; 0: none, else at least 5.", min=0, max=10_000)
    ] = 50,
    as_json: Json = False,
) -> None:
    """Check that memory, descriptors, threads and files of every process stay flat when a graph runs for long.

    One scene is streamed in real time to a subscriber of all sensors; then short scenes on alternating maps are
    recorded by one graph. The first fifth of each run is warm-up; from then on, lines are fitted to the samples. Memory
    means heap and stacks, without mapped files. If memory rises by more than 10 % and 16 MiB anywhere, or a number
    of descriptors, threads or files by more than 2, the exit code is 1.

    [bold]Example[/]

    python -m tools.bench endurance --minutes 5 --scenes 10
    """
    from simbev_ros.cli.production_display import SceneDisplay
    from tools.bench.endurance import MIN_SCENES, measure_endurance

    if 0 < scenes < MIN_SCENES:
        raise InputError(f"{scenes}; allowed: 0, or {MIN_SCENES} to 10000", parameter="scenes")
    result = measure_endurance(60 * minutes, scenes, SceneDisplay(make_console(stderr=True)))
    growth = result.growth()
    show_timing(
        result,
        "what a graph holds after warm-up and at the end",
        ("run", "", "MiB", "end", "MiB/h", "counts"),
        result.rows(),
        as_json=as_json,
        comparison="\n".join(growth) or "nothing grows",
    )
    raise typer.Exit(1 if growth else 0)
