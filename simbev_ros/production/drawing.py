"""Drawing the scenes that a configuration or the plan of a dataset asks for."""

from collections.abc import Iterable, Mapping

from simbev_ros.config.scenario import Scenario
from simbev_ros.dataset.plan import PlannedEntry
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.latest_value import LatestValue
from simbev_ros.production.observer import SILENT, ProductionObserver
from simbev_ros.production.surroundings import load_roads
from simbev_ros.scene.drawing.chosen_maps import maps_of
from simbev_ros.scene.drawing.draw_scene import PlannedScene, draw_scene, planned_scenes, start_positions
from simbev_ros.scene.drawing.starts import StartPositions
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.spec import SceneSpec


def draw_scenes(scenario: Scenario, observer: ProductionObserver = SILENT) -> list[SceneSpec]:
    """Draw all scenes that a configuration asks for, in its order.

    Raises:
        InputError: A map cannot be used, or has no room for a scene.
    """
    planned = list(planned_scenes(scenario))
    networks = {spec: load_roads(spec, observer) for spec in dict.fromkeys(scene.map for scene in planned)}
    starts = {spec: start_positions(scenario, network) for spec, network in networks.items()}
    return [draw_scene(scenario, scene, networks[scene.map], starts[scene.map]) for scene in planned]


class PlannedSceneDrawer:
    """Draws scenes of a dataset's plan one by one; consecutive scenes of one map share its start positions.

    Args:
        scenario: The configuration.
        observer: Receives the progress.
        maps: The configuration's maps, where their files may not be at hand; None: they are resolved here.
    """

    def __init__(
        self,
        scenario: Scenario,
        observer: ProductionObserver = SILENT,
        maps: Iterable[MapSpec] | None = None,
    ) -> None:
        self._scenario, self._observer = scenario, observer
        self._maps: Mapping[str, MapSpec] = {spec.name: spec for spec in maps or maps_of(scenario)}
        self._starts = LatestValue[MapSpec, StartPositions]()

    def draw(self, entry: PlannedEntry) -> SceneSpec:
        """Draw a scene.

        Raises:
            InputError: It cannot be drawn, or its map is not one of the configuration's.
        """
        if entry.map not in self._maps:
            raise InputError(f"scene {entry.name}: the configuration has no map {entry.map}")
        spec = self._maps[entry.map]
        network = load_roads(spec, self._observer)
        starts = self._starts.get(spec, lambda: start_positions(self._scenario, network))
        planned = PlannedScene(entry.number, spec, entry.split)
        return draw_scene(self._scenario, planned, network, starts)
