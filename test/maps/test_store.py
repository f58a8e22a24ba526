from dataclasses import fields, is_dataclass, replace
from pathlib import Path

import numpy as np
import pytest
import shapely

from simbev_ros.maps.findings import Finding, Outcome
from simbev_ros.maps.land_features import Footprint, MapFeatures, MapObject, ObjectKind, Water, Zone
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.layout import Crosswalk, Line, Paint, PaintColor, Sign, SignalPlace, SignKind, StopLine
from simbev_ros.maps.store import NET, OPENDRIVE, read_datum, read_network, write_network
from simbev_ros.maps.surroundings import SurroundingsRecipe


def _same(a: object, b: object) -> bool:
    """Whether two values are bitwise equal, including arrays and nested values."""
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if is_dataclass(a) and not isinstance(a, type):
        return type(a) is type(b) and all(_same(getattr(a, f.name), getattr(b, f.name)) for f in fields(a))
    if isinstance(a, dict) and isinstance(b, dict):
        return list(a) == list(b) and all(_same(a[key], b[key]) for key in a)
    if isinstance(a, tuple) and isinstance(b, tuple):
        return len(a) == len(b) and all(map(_same, a, b))
    return type(a) is type(b) and a == b


@pytest.fixture
def rich(blocks: RoadNetwork, tmp_path: Path) -> RoadNetwork:
    """A map with at least one of everything that can be stored."""
    strips = list(blocks.layout.strips)
    strips[0] = replace(strips[0], left_line=Line(Paint.BOTTS_DOTS, PaintColor.RED, 0.3), level=2, structure=True)
    mount = SignalPlace(np.array([1.0, 2, 3]), np.array([1.0, 2, 8]), 0.5, ("a_1", "b_0"))
    corner_m = np.array([[0.0, 0, 1], [4, 0, 1], [4, 2, 1.5]])
    layout = replace(
        blocks.layout,
        strips=tuple(strips),
        crosswalks=(*blocks.layout.crosswalks, Crosswalk(corner_m, np.array([0.6, 0.8]), 1)),
        stop_lines=(*blocks.layout.stop_lines, StopLine(corner_m[:2], 1, yields=True)),
        signs=(Sign(SignKind.SPEED_LIMIT, corner_m[0], -1.0, (), 13.9),),
        signal_places=(mount,),
        corner_radius_m=1.5,
    )
    hole = shapely.Point(0, 0).buffer(9).difference(shapely.Point(0, 0).buffer(3))
    recipe = SurroundingsRecipe.model_validate({"use": "campus", "building_height_m": {"uniform": [3, 4]}})
    tower = Footprint(hole, 7.0, "office", "skillion", 2.5, 1.5, 0.7, "brick", 0xFF8000, 0x4E4A48)
    features = MapFeatures(
        recipe,
        (Zone(hole, recipe),),
        water=(Water(hole, -2.5),),
        buildings=(tower,),
        objects=(
            MapObject(ObjectKind.WALL, corner_m, 2.0, 0.5, 1.0),
            MapObject(ObjectKind.TREE, corner_m[:1], yaw_rad=0.0),
        ),
    )
    (tmp_path / NET).write_text("net")
    (tmp_path / OPENDRIVE).write_text("roads")
    return replace(
        blocks,
        layout=layout,
        features=features,
        findings=(
            Finding("One line."),
            Finding("An umlaut: ä", Outcome.ASSUMED, 2, 7, "detail", np.array([1.5, -2.5]), 3.0),
        ),
        net_path=tmp_path / NET,
        opendrive_path=tmp_path / OPENDRIVE,
    )


def test_a_stored_network_is_restored_bit_for_bit(rich: RoadNetwork, tmp_path: Path) -> None:
    write_network(rich, tmp_path)
    assert _same(read_network(tmp_path, seed=rich.seed), rich)
    assert read_datum(tmp_path) == rich.datum
    assert read_network(tmp_path, seed=5).seed == 5


def test_a_map_with_only_lanes_is_restored(rich: RoadNetwork, tmp_path: Path) -> None:
    bare = replace(
        rich,
        signals=(),
        junctions={},
        layout=replace(rich.layout, crosswalks=(), stop_lines=(), signs=(), signal_places=()),
        features=MapFeatures(rich.features.surroundings),
        findings=(),
    )
    write_network(bare, tmp_path)
    assert _same(read_network(tmp_path, seed=bare.seed), bare)


@pytest.mark.parametrize("name", [NET, OPENDRIVE, "network.npz"])
def test_damage_is_detected(rich: RoadNetwork, tmp_path: Path, name: str) -> None:
    write_network(rich, tmp_path)
    content = (tmp_path / name).read_bytes()
    (tmp_path / name).write_bytes(content[: len(content) // 2])
    with pytest.raises(ValueError, match=tmp_path.name):
        read_network(tmp_path, seed=0)
    (tmp_path / name).unlink()
    with pytest.raises(ValueError, match=tmp_path.name):
        read_network(tmp_path, seed=0)


def test_a_flipped_byte_is_detected(rich: RoadNetwork, tmp_path: Path) -> None:
    write_network(rich, tmp_path)
    content = bytearray((tmp_path / "network.npz").read_bytes())
    content[len(content) // 2] ^= 0xFF
    (tmp_path / "network.npz").write_bytes(content)
    with pytest.raises(ValueError, match=tmp_path.name):
        read_network(tmp_path, seed=0)
