"""Surroundings that another process builds at the same time are waited for, not built again."""

from pathlib import Path

import pytest
from analytic_maps import hilly_road

from simbev_ros.assets.actors import catalog
from simbev_ros.assets.regions.static_cache import StaticCache
from simbev_ros.config.scenario import Scenario
from simbev_ros.maps.region import Region
from simbev_ros.production import ProductionObserver, surroundings
from simbev_ros.production.drawing import draw_scenes
from simbev_ros.production.events import ProductionEvent, SurroundingsStarted
from simbev_ros.production.surroundings import build_missing_regions, build_surroundings
from simbev_ros.schema.scene.map_spec import MapSpec

SPEC = MapSpec(name="analytic", seed=0)
EAST, WEST = Region(0, 0), Region(-1, 0)


class Counting(ProductionObserver):
    """Notes the numbers of regions that were announced."""

    def __init__(self) -> None:
        self.announced: list[int] = []

    def notify(self, event: ProductionEvent) -> None:
        if isinstance(event, SurroundingsStarted):
            self.announced.append(event.regions)


@pytest.mark.parametrize(("left", "announced"), [((), []), ((WEST,), [1])])
def test_only_what_is_missing_after_the_wait_is_built(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, left: tuple[Region, ...], announced: list[int]
) -> None:
    answers, built, observer = [(EAST, WEST), left], list[Region](), Counting()
    monkeypatch.setattr(StaticCache, "missing", lambda *_: answers.pop(0))
    monkeypatch.setattr(surroundings, "build_regions", lambda _spec, regions, *_: built.extend(regions))
    build_missing_regions(SPEC, hilly_road(), [EAST, WEST], observer, tmp_path)
    assert (tuple(built), observer.announced) == (left, announced)


@pytest.mark.parametrize("coarser", [False, True])
@pytest.mark.parametrize("missing", [(), ("exact.npz",), ("coarser.npz",)])
def test_actors_are_built_before_nodes_would_wait_for_one_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, missing: tuple[str, ...], coarser: bool
) -> None:
    for name in {"exact.npz", "coarser.npz"}.difference(missing):
        (tmp_path / name).touch()
    loaded: list[str] = []
    monkeypatch.setattr(catalog, "_folder", lambda: tmp_path)
    monkeypatch.setattr(catalog, "load_models", lambda: loaded.append("exact.npz"))
    monkeypatch.setattr(catalog, "_all_coarser", lambda: loaded.append("coarser.npz"))
    catalog.build_models(coarser=coarser)
    assert loaded == [name for name in missing if coarser or name == "exact.npz"]


@pytest.mark.parametrize(("sensors", "coarser"), [([{"type": "camera", "name": "front"}], True), ([], False)])
def test_only_cameras_need_coarser_meshes(
    monkeypatch: pytest.MonkeyPatch, sensors: list[dict[str, str]], coarser: bool
) -> None:
    built: list[bool] = []
    monkeypatch.setattr(surroundings, "build_models", lambda *, coarser: built.append(coarser))
    monkeypatch.setattr(surroundings, "build_missing_regions", lambda *_: None)
    values = {"scenes": [{"map": "Blocks", "train": 1}], "rig": {"sensors": sensors}, "traffic": {"vehicles": 0}}
    build_surroundings(draw_scenes(Scenario.model_validate(values)))
    assert built == [coarser]
