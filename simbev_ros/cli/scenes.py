"""Playing the scenes of a configuration on a graph, with a progress bar: what ``run``, ``demo`` and ``bench`` share."""

from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from itertools import chain, zip_longest
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, Task, TextColumn, TimeRemainingColumn
from rich.text import Text

from simbev_ros.assets.regions.region_pool import build_regions
from simbev_ros.assets.regions.static_cache import StaticCache
from simbev_ros.cli.live_evaluation import print_live_tables
from simbev_ros.cli.record_place import held_place
from simbev_ros.config.scenario import Scenario
from simbev_ros.errors import SimbevError
from simbev_ros.graph.session import GraphSession
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.region import Region, regions_of
from simbev_ros.maps.spec import MapSpec
from simbev_ros.recording.layout import scene_folder
from simbev_ros.scene.drawing.draw_scene import draw_scene, planned_scenes, starts_of
from simbev_ros.scene.ending import DURATION
from simbev_ros.scene.reach import loaded_reach
from simbev_ros.scene.spec import SceneSpec


def play_scenes(
    scenario: Scenario, console: Console, *, live: bool = False, dataset: Path | None = None, domain: int | None = None
) -> list[Path]:
    """Play every scene of a configuration; give the folders of the bags.

    Everything that can be wrong with the input is found out before the graph starts.

    Raises:
        InputError: a scene cannot be drawn, or its bag cannot be written.
        GraphError: a node died or fell silent.
    """
    specs = drawn_scenes(scenario, console)
    bags = list(played(scenario, specs, console, live=live, dataset=dataset, domain=domain))
    return bags if dataset is not None else []


def played(
    scenario: Scenario,
    specs: Sequence[SceneSpec],
    console: Console,
    *,
    live: bool = False,
    dataset: Path | None = None,
    domain: int | None = None,
    replays: Sequence[Path] = (),
) -> Generator[Path, None, None]:
    """Play scenes on one graph, one after the other; give the folder of each one's bag, recorded or not, when it ends.

    The graph goes on until the generator is used up or closed.

    Args:
        scenario: The configuration.
        specs: The scenes.
        console: For progress.
        live: In real time.
        dataset: Where to record.
        domain: ROS domain.
        replays: Of each scene a bag to take all motion from; none: it is simulated.

    Raises:
        InputError: a scene's bag cannot be written.
        DiskError: the disk is full, or nearly.
        GraphError: a node died or fell silent.
    """
    with ExitStack() as held:
        if dataset is not None:
            held.enter_context(held_place(dataset, scenario, specs, console, live=live))
        build_surroundings(specs, console)
        session = GraphSession(scenario, live=live, dataset=dataset, domain=domain)
        held.enter_context(_graph(session, console))
        console.print(f"ROS_DOMAIN_ID={session.domain}", style="dim")
        for spec, replay in zip_longest(specs, replays):
            with scene_progress(spec, console) as progress:
                end = session.play(spec, progress, replay)
            if end.reason != DURATION:
                console.print(f"{spec.name} ended early: {end.reason}", markup=False, highlight=False, soft_wrap=True)
            yield scene_folder(dataset or Path(), spec.split, spec.name)


@contextmanager
def _graph(session: GraphSession, console: Console) -> Iterator[GraphSession]:
    """Runs a graph; when it has ended, also by Ctrl-C, its figures are printed, if a stack was evaluated."""
    failed = False
    try:
        with session:
            yield session
    except SimbevError:  # its message is what counts; the figures of a part are in the file
        failed = True
        raise
    finally:
        if session.figures is not None and not failed:
            print_live_tables(session.figures, console)


def build_surroundings(specs: Sequence[SceneSpec], console: Console) -> None:
    """Fill the cache on disk, so that the nodes, which all need the static scene, find it there."""
    for map_spec in dict.fromkeys(spec.map for spec in specs):
        network = load_network(map_spec)
        seen = [regions_of(network.layout, loaded_reach(spec, network)) for spec in specs if spec.map == map_spec]
        prepare_regions(map_spec, network, tuple(dict.fromkeys(chain.from_iterable(seen))), console)


def prepare_regions(
    spec: MapSpec, network: RoadNetwork, regions: Sequence[Region], console: Console, cache_dir: Path | None = None
) -> None:
    """Build what is not in the cache yet, on all cores, with a progress bar.

    Raises:
        InputError: the cache cannot be written.
    """
    missing = StaticCache(spec, network, cache_dir).missing(regions)
    if not missing:
        return
    columns = (TextColumn("{task.description}"), BarColumn(bar_width=None), MofNCompleteColumn(), TextColumn("regions"))
    with Progress(*columns, console=console, expand=True, transient=True) as bars:
        task = bars.add_task(f"surroundings of {escape(spec.name)}", total=len(missing))
        build_regions(spec, missing, cache_dir, lambda: bars.advance(task))


def drawn_scenes(scenario: Scenario, console: Console) -> list[SceneSpec]:
    """All scenes that a configuration asks for; says what had to be repaired in their maps."""
    planned = list(planned_scenes(scenario))
    networks = {spec: map_roads(spec, console) for spec in dict.fromkeys(scene.map for scene in planned)}
    starts = {spec: starts_of(scenario, network) for spec, network in networks.items()}
    return [draw_scene(scenario, scene, networks[scene.map], starts[scene.map]) for scene in planned]


def map_roads(spec: MapSpec, console: Console) -> RoadNetwork:
    """A map's roads, and on the console its notes."""
    with console.status(f"roads of {escape(spec.name)}"):
        network = load_network(spec)
    for note in network.notes:
        console.print(f"map {spec.name}: {note}", style="dim", markup=False, highlight=False, soft_wrap=True)
    return network


@contextmanager
def scene_progress(spec: SceneSpec, console: Console) -> Iterator[Callable[[int | None], None]]:
    """A progress bar of one scene; gives the function that is told the last finished tick."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=None),
        MofNCompleteColumn(),
        TextColumn("ticks"),
        _TickRate(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, expand=True) as bars:
        task = bars.add_task(f"{spec.name}: loading", total=None)

        def progress(tick: int | None) -> None:
            if tick is not None:
                bars.update(task, description=spec.name, total=spec.ticks, completed=max(tick + 1, 0))

        yield progress


class _TickRate(ProgressColumn):
    """Ticks per second, of late."""

    def render(self, task: Task) -> Text:
        speed = task.finished_speed or task.speed
        return Text("" if speed is None else f"{speed:.1f} ticks/s", style="progress.data.speed")
