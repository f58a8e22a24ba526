"""Makes scenes of a dataset one by one, on a graph that starts with the first scene and restarts after a failure.

In: entries of the dataset's plan, or replays. Out: a finished bag in a folder for unfinished work, with its row for the
index, or the reason why there is none. It runs in the process of ``make_dataset`` or ``replay_bags``, or in a worker,
here or on another machine.
"""

import shutil
from collections.abc import Iterable
from pathlib import Path

from simbev_ros.config.rendering import Rendering
from simbev_ros.config.scenario import Scenario
from simbev_ros.dataset.index_row import index_row
from simbev_ros.dataset.plan import PlannedEntry, bag_of
from simbev_ros.foundation.errors import SimbevError
from simbev_ros.production.drawing import PlannedSceneDrawer
from simbev_ros.production.free_stations import require_free_stations
from simbev_ros.production.observer import SILENT, ProductionObserver
from simbev_ros.production.play import play_on
from simbev_ros.production.replay.entry import ReplayedEntry, replayed_scene
from simbev_ros.production.scene_cost import CostMeter
from simbev_ros.production.scene_ending import FailedScene, MadeScene, Output
from simbev_ros.production.surroundings import build_surroundings
from simbev_ros.production.upload import Uploader
from simbev_ros.ros.graph.resources import temporary_folder
from simbev_ros.ros.graph.session import GraphSession
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.spec import SceneSpec


class SceneMaker:
    """Makes scenes on a graph of its own.

    Args:
        scenario: The configuration.
        staging: Folder for unfinished scenes that nothing else uses, laid out like a dataset; None: a temporary one.
        observer: Receives the progress.
        maps: The configuration's maps, where their files may not be at hand; None: they are resolved here.
        rendering: Devices that render, in place of the configuration's.
        uploader: Uploads finished bags; None: they stay in ``staging``.
    """

    def __init__(
        self,
        scenario: Scenario,
        staging: Path | None,
        observer: ProductionObserver = SILENT,
        *,
        maps: Iterable[MapSpec] | None = None,
        rendering: Rendering | None = None,
        uploader: Uploader | None = None,
    ) -> None:
        self._scenario, self._observer = scenario, observer
        self._rendering, self._uploader = rendering, uploader
        self._staging = staging or temporary_folder()
        self._maps = maps
        self._drawer: PlannedSceneDrawer | None = None
        self._session: GraphSession | None = None

    def make(self, entry: PlannedEntry) -> MadeScene | FailedScene:
        """Make a scene; its bag is in the staging folder, or uploaded."""
        shutil.rmtree(bag_of(self._staging, entry).parent, ignore_errors=True)
        try:
            return self._make(entry)
        except SimbevError as error:
            return FailedScene(error, self._stop_graph())

    def close(self) -> None:
        """Stop the graph and remove the folder for unfinished scenes."""
        self._stop_graph()
        shutil.rmtree(self._staging, ignore_errors=True)

    def _make(self, entry: PlannedEntry) -> MadeScene:
        spec, replay = self._scene_of(entry)
        build_surroundings([spec], self._observer)
        require_free_stations(self._scenario, [spec])
        session = self._running_session()
        meter = CostMeter(session.pids().values())

        def look(_: int | None) -> None:
            meter.look(session.pids().values())

        end = play_on(session, spec, self._observer, replay=replay, on_tick=look)
        bag = bag_of(self._staging, entry)
        row = index_row(bag, self._staging)
        cost = meter.cost(session.pids().values(), row["recorded_ticks"])
        if self._uploader is not None:
            self._uploader.upload(bag, entry)
            shutil.rmtree(bag)
        summary = f"{end.reason} after tick {end.tick}, {row['bytes']:,} bytes"
        output = self._stop_graph() if session.has_lost_driver else self._new_output()
        return MadeScene(row, summary, output, cost)

    def _scene_of(self, entry: PlannedEntry) -> tuple[SceneSpec, Path | None]:
        """The scene to play, and the bag to take its motion from; None: motion is simulated."""
        if isinstance(entry, ReplayedEntry):
            return replayed_scene(entry.bag, self._scenario, self._observer), entry.bag
        if self._drawer is None:
            self._drawer = PlannedSceneDrawer(self._scenario, self._observer, self._maps)
        return self._drawer.draw(entry), None

    def _running_session(self) -> GraphSession:
        if self._session is None:
            session = GraphSession(self._scenario, dataset=self._staging, rendering=self._rendering)
            session.start()
            self._session = session
        return self._session

    def _new_output(self) -> Output:
        return {} if self._session is None else self._session.new_output()

    def _stop_graph(self) -> Output:
        """Stop the graph, if it runs, and return what its processes have written since the last call."""
        output = self._new_output()
        if self._session is not None:
            self._session.close()
            self._session = None
        return output
