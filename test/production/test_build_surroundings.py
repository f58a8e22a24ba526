"""Surroundings that another process builds at the same time are waited for, not built again."""

from pathlib import Path

import numpy as np
import pytest
from analytic_maps import hilly_road

from simbev_ros.assets import build_pool
from simbev_ros.assets.actors import catalog
from simbev_ros.assets.regions.static_cache import StaticCache
from simbev_ros.config.scenario import Scenario
from simbev_ros.maps.region import Region
from simbev_ros.production import ProductionObserver, surroundings
from simbev_ros.production.drawing import draw_scenes
from simbev_ros.production.events import ProductionEvent, SurroundingsStarted
from simbev_ros.production.surroundings import build_missing_regions, build_surroundings
from simbev_ros.scene.blueprints import load_blueprints
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
    monkeypatch.setattr(catalog, "_exact", lambda mapped: loaded.append("exact.npz"))
    monkeypatch.setattr(catalog, "_coarser", lambda mapped: loaded.append("coarser.npz"))
    catalog.build_models(coarser=coarser)
    assert loaded == [name for name in missing if coarser or name == "exact.npz"]


def test_models_are_the_same_from_one_process_and_from_several(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    blueprints = load_blueprints()[:3]
    monkeypatch.setattr(catalog, "load_blueprints", lambda: blueprints)
    for name, cores in (("one", 1), ("several", 2)):
        monkeypatch.setattr(build_pool, "usable_cores", lambda cores=cores: cores)
        monkeypatch.setattr(catalog, "_folder", lambda name=name: tmp_path / name)
        catalog.build_models(coarser=True)
    for file in ("exact.npz", "coarser.npz"):
        one, several = (np.load(tmp_path / name / file) for name in ("one", "several"))
        assert one.files == several.files
        for array in one.files:
            np.testing.assert_array_equal(one[array], several[array])


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
