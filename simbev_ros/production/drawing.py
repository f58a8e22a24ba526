"""Drawing the scenes that a configuration or the plan of a dataset asks for, until its rules accept them."""

from collections.abc import Iterable, Mapping

from simbev_ros.assets.regions.static_cache import load_streetside
from simbev_ros.config.scenario import Scenario
from simbev_ros.dataset.plan import PlannedEntry
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.latest_value import LatestValue
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.production.events import SceneRefused
from simbev_ros.production.observer import SILENT, ProductionObserver, observe_step
from simbev_ros.production.open_stations import enclosed_units
from simbev_ros.production.surroundings import build_surroundings, load_roads
from simbev_ros.scene.drawing.chosen_maps import maps_of
from simbev_ros.scene.drawing.draw_events import missing_events
from simbev_ros.scene.drawing.draw_scene import PlannedScene, draw_scene, planned_scenes, start_positions
from simbev_ros.scene.drawing.starts import StartPositions
from simbev_ros.scene.reach import loaded_reach
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.simulation.world.rehearsal import rehearse

_MAX_DRAWS = 50  # without rules


def draw_scenes(scenario: Scenario, observer: ProductionObserver = SILENT) -> list[SceneSpec]:
    """Draw all scenes that a configuration asks for, in its order.

    Raises:
        InputError: A map cannot be used or has no room for a scene, or the configuration accepts no draw of one.
    """
    planned = list(planned_scenes(scenario))
    networks = {spec: load_roads(spec, observer) for spec in dict.fromkeys(scene.map for scene in planned)}
    starts = {spec: start_positions(scenario, network) for spec, network in networks.items()}
    return [draw_accepted(scenario, scene, networks[scene.map], starts[scene.map], observer) for scene in planned]


def draw_accepted(
    scenario: Scenario,
    planned: PlannedScene,
    network: RoadNetwork,
    starts: StartPositions,
    observer: ProductionObserver = SILENT,
) -> SceneSpec:
    """Draw a scene as ``draw_scene`` does, again with the next seed for as long as it breaks a rule of ``accept``.

    It is also drawn again if a roadside unit in a drawn place has no free view, or the route has no room for required
    events.

    Raises:
        InputError: It cannot be drawn, or no draw is accepted.
    """
    rules = scenario.accept
    max_draws = _MAX_DRAWS if rules is None else rules.max_draws
    for draw in range(max_draws):
        spec = draw_scene(scenario, planned._replace(draw=draw), network, starts)
        problems = [*missing_events(scenario, spec), *enclosed_units(scenario, spec, observer)]
        if rules is not None and not problems:
            build_surroundings([spec], observer)
            with observe_step(observer, f"traffic of {spec.name}, for the rules of accept"):
                streetside = load_streetside(spec.map, network, reach=loaded_reach(spec, network))
                problems = rehearse(spec, network, streetside).problems(rules)
        if not problems:
            return spec
        observer.notify(SceneRefused(spec.name, tuple(problems)))
    words = f"none of {max_draws} draws is accepted; the last one: {'; '.join(problems)}"
    raise InputError(f"scene {spec.name}: {words if rules is None else f'accept: {words}'}")


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
            InputError: It cannot be drawn, no draw is accepted, or its map is not one of the configuration's.
        """
        if entry.map not in self._maps:
            raise InputError(f"scene {entry.name}: the configuration has no map {entry.map}")
        spec = self._maps[entry.map]
        network = load_roads(spec, self._observer)
        starts = self._starts.get(spec, lambda: start_positions(self._scenario, network))
        planned = PlannedScene(entry.number, spec, entry.split, scenario=entry.scenario)
        return draw_accepted(self._scenario, planned, network, starts, self._observer)
