"""Puts the objects that a map prescribes into a region: things at a point, barriers along a line, solid outlines."""

from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from itertools import pairwise

import numpy as np
import shapely

from simbev_ros.assets.flora import species as flora
from simbev_ros.assets.land.covers import BAY_LINE, PAINT_RISE_M
from simbev_ros.assets.land.fencing import put_panels
from simbev_ros.assets.land.yard import Yard
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import Finish, extrusion
from simbev_ros.assets.palette import pick_color, rgb
from simbev_ros.assets.placement.nearby_objects import TREE_KINDS
from simbev_ros.assets.placement.static_scene import StreetLight
from simbev_ros.assets.placement.tiles import upright_pose
from simbev_ros.assets.roads.guard_rails import guard_rail
from simbev_ros.assets.street.barriers import VARIANTS, panel
from simbev_ros.assets.street.furniture import bench, bicycle_rack, bus_shelter, cabinet, hydrant, litter_bin, mailbox
from simbev_ros.assets.street.poles import STREET_LAMP_AT_M, cables, street_light, utility_pole, with_lamp_index
from simbev_ros.assets.street.surface import surface_m
from simbev_ros.assets.street.tracks import lay_track
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.geometry.plan_view import left_of, polygon_parts
from simbev_ros.foundation.geometry.transforms import apply
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.land_features import MapObject, ObjectKind

_MODELS: Mapping[ObjectKind, Callable[[], Mesh]] = {
    ObjectKind.STREET_LAMP: street_light,
    ObjectKind.UTILITY_POLE: utility_pole,
    ObjectKind.BENCH: bench,
    ObjectKind.HYDRANT: hydrant,
    ObjectKind.CABINET: cabinet,
    ObjectKind.MAILBOX: mailbox,
    ObjectKind.BICYCLE_RACK: bicycle_rack,
    ObjectKind.BUS_SHELTER: bus_shelter,
}
_TALL = (ObjectKind.STREET_LAMP, ObjectKind.UTILITY_POLE)  # models that are scaled to the height that the map gives
_SPECIES = {ObjectKind.CONIFER: "spruce", ObjectKind.PALM: "palm", ObjectKind.BUSH: "hazel"}
_PANELS = {ObjectKind.WALL: "wall", ObjectKind.FENCE: "bars", ObjectKind.HEDGE: "hedge"}
_PARKING = (ObjectKind.PARKING_LOT, ObjectKind.PARKING_SPACE)
_HIGH_HEDGE_M = 1.6
_FOOT_M, _ROOM_M = 0.3, 0.4
_STEP_M, _MIN_LINE_M = 4.0, 0.5
_ASPHALT_RISE_M, _LINE_M = 0.016, 0.1
_MAX_SPAN_M, _MAX_SCALE = 120.0, 4.0


def put_map_objects(yard: Yard) -> Iterator[StreetLight]:
    """Put the objects of the map that stand in the region, and yield the light sources of its street lamps."""
    lamps = 0
    items = yard.map_objects.items
    firsts_m = np.array([item.points_m[0] for item in items]).reshape(-1, 3)
    levels = yard.ground.terrain.elevation.level_at(firsts_m)
    for item, level in zip(items, levels.tolist(), strict=True):
        if item.kind in _PARKING:
            _pave_parking(yard, item)
            continue
        if len(item.points_m) > 1 and not item.is_outline:
            put = _put_power_line if item.kind is ObjectKind.UTILITY_POLE else _put_barrier
            put(yard, item, level)
            continue
        middle_m = item.points_m[:-1, :2].mean(axis=0) if item.is_outline else item.points_m[0, :2]
        if not yard.ground.owns(middle_m[None])[0]:
            continue
        if item.is_outline:
            _put_solid(yard, item, middle_m, level)
        elif item.kind in (*TREE_KINDS, ObjectKind.BUSH):
            _plant(yard, item, middle_m, level)
        else:
            pose = _pose(yard, item, middle_m, level)
            yard.tiles.place(with_lamp_index(_model(yard, item), (Material.STREET_LAMP,), lamps), pose, level)
            if item.kind is ObjectKind.STREET_LAMP:
                x_m, y_m, z_m = apply(pose, np.array([STREET_LAMP_AT_M]))[0].tolist()
                lamps += 1
                yield StreetLight((x_m, y_m, z_m))


def _model(yard: Yard, item: MapObject) -> Mesh:
    """Mesh of a thing with a model of its own."""
    if item.kind is ObjectKind.BIN:
        return litter_bin(pick_color(_stream(yard, item), "bins", 0.0))
    return _MODELS[item.kind]()


def _pose(yard: Yard, item: MapObject, xy_m: Float64Array, level: int) -> Float64Array:
    """(4, 4) pose of a thing, scaled to its height; its footprint is claimed."""
    if not level:
        yard.claims.add(shapely.Point(xy_m).buffer(_ROOM_M, quad_segs=2))
    yaw_rad = item.yaw_rad if np.isfinite(item.yaw_rad) else _toward_road_rad(yard, xy_m, level)
    height_m = float(surface_m(yard.ground, xy_m[None], level)[0]) + item.bottom_m
    pose = upright_pose(xy_m, height_m, yaw_rad)
    if item.kind in _TALL and item.height_m > 0.0:
        pose[:3, :3] *= _scale(item, _model(yard, item))
    return pose


def _scale(item: MapObject, mesh: Mesh) -> float:
    """Factor from the height of a model to that of an object, within reason."""
    return min(item.height_m / float(mesh.bounds_m[1, 2]), _MAX_SCALE)


def _toward_road_rad(yard: Yard, xy_m: Float64Array, level: int) -> float:
    """Heading from a point to the nearest road."""
    road = yard.ground.streets[level].road
    if road.is_empty:
        return 0.0
    start_m, end_m = shapely.get_coordinates(shapely.shortest_line(shapely.Point(xy_m), road))
    return float(np.arctan2(*(end_m - start_m)[::-1]))


def _plant(yard: Yard, item: MapObject, xy_m: Float64Array, level: int) -> None:
    """A tree or bush from the stock, scaled to its height."""
    rng = _stream(yard, item)
    landscape = yard.ground.network.features.surroundings.plants
    species = _SPECIES.get(item.kind) or flora.draw_species(landscape, "street", 1, rng)[0]
    plant = flora.stock(species, int(rng.integers(flora.VARIANTS)), yard.ground.season)
    scale = _scale(item, plant.mesh) if item.height_m > 0.0 else rng.uniform(0.85, 1.15)
    pose = upright_pose(xy_m, float(surface_m(yard.ground, xy_m[None], level)[0]), rng.uniform(0.0, 2.0 * np.pi))
    pose[:3, :3] *= scale
    if level:
        yard.tiles.place(plant.mesh, pose, level)
    else:
        yard.claims.add(shapely.Point(xy_m).buffer(_ROOM_M, quad_segs=2))
        yard.tiles.place_copies(plant, pose[None])


def _put_solid(yard: Yard, item: MapObject, middle_m: Float64Array, level: int) -> None:
    """A solid on an outline, each vertex at its height above the surface below it."""
    finish, usual_m = _finishes()[item.kind]
    area = shapely.make_valid(shapely.Polygon(item.points_m[:, :2] - middle_m))
    bottom_m, top_m = item.bottom_m, item.bottom_m + (item.height_m or usual_m)
    base_m = float(surface_m(yard.ground, middle_m[None], level)[0])
    for part in polygon_parts(area):
        mesh = extrusion(finish, part, bottom_m - _FOOT_M if bottom_m < _FOOT_M else bottom_m, top_m)
        below_m = surface_m(yard.ground, mesh.vertices[:, :2] + middle_m, level)
        mesh.vertices[:, 2] += (below_m - base_m).astype(np.float32)
        yard.tiles.place(mesh, upright_pose(middle_m, base_m), level)
    if not level and bottom_m < _FOOT_M:
        taken = shapely.transform(area, lambda xy_m: xy_m + middle_m)
        yard.claims.add(overlay.intersection(taken, yard.ground.region.area))


def _put_barrier(yard: Yard, item: MapObject, level: int) -> None:
    """Panels along a line, or a guard rail, within the region and off the streets."""
    square = yard.ground.region.area if item.kind is ObjectKind.RAILS else yard.inside
    line = overlay.intersection(shapely.LineString(item.points_m[:, :2]), square)
    parts = [part for part in shapely.get_parts(line) if part.geom_type == "LineString" and part.length > _MIN_LINE_M]
    if level or not parts:
        return
    variant = int(_stream(yard, item).integers(VARIANTS))
    for part in parts:
        if item.kind is ObjectKind.RAILS:
            lay_track(yard, part)
        elif item.kind is ObjectKind.GUARD_RAIL:
            middle_m = shapely.get_coordinates(part.interpolate(0.5, normalized=True))[0]
            rail = guard_rail(yard.ground, shapely.segmentize(part, _STEP_M))
            yard.tiles.place(rail.transform(upright_pose(-middle_m, 0.0)), upright_pose(middle_m, 0.0))
        elif item.kind in _PANELS:
            is_high = item.kind is ObjectKind.HEDGE and item.height_m > _HIGH_HEDGE_M
            kind = "high_hedge" if is_high else _PANELS[item.kind]
            for start_m, end_m in pairwise(shapely.get_coordinates(part)):
                put_panels(
                    yard, panel(kind, variant, yard.ground.season), kind, start_m, end_m, yard.ground.region.area
                )


def _put_power_line(yard: Yard, item: MapObject, level: int) -> None:
    """Poles at the points of a line in the region, and cables from each of them to the next one."""
    xy_m = item.points_m[:, :2]
    along = np.gradient(xy_m, axis=0)
    across = left_of(along / np.maximum(np.hypot(*along.T), 1e-9)[:, None])
    owned = yard.ground.owns(xy_m)
    if level or not owned.any():
        return
    feet_m = np.column_stack([xy_m, surface_m(yard.ground, xy_m, 0)])
    for row in np.flatnonzero(owned).tolist():
        yard.claims.add(shapely.Point(xy_m[row]).buffer(_ROOM_M, quad_segs=2))
        yaw_rad = float(np.arctan2(across[row, 1], across[row, 0]))
        yard.tiles.place(utility_pole(), upright_pose(xy_m[row], feet_m[row, 2], yaw_rad))
        if row + 1 < len(xy_m) and np.hypot(*(xy_m[row + 1] - xy_m[row])) < _MAX_SPAN_M:
            mesh = cables(feet_m[row], feet_m[row + 1], across[row])
            yard.tiles.place(mesh, upright_pose(xy_m[row], feet_m[row, 2]))


def _pave_parking(yard: Yard, item: MapObject) -> None:
    """Asphalt off the streets, and lines around a parking space."""
    area = overlay.intersection(shapely.make_valid(shapely.Polygon(item.points_m[:, :2])), yard.ground.land)
    yard.cover(area, "asphalt", rise_m=_ASPHALT_RISE_M)
    yard.claims.add(area)
    if item.kind is ObjectKind.PARKING_SPACE:
        yard.cover(overlay.difference(area, shapely.buffer(area, -_LINE_M)), BAY_LINE, rise_m=PAINT_RISE_M)


def _stream(yard: Yard, item: MapObject) -> np.random.Generator:
    """Random generator of an object, by its position."""
    x_m, y_m = item.points_m[0, :2]
    return yard.ground.stream(f"map_object.{item.kind}.{x_m:.2f}.{y_m:.2f}")


@lru_cache(maxsize=1)
def _finishes() -> Mapping[ObjectKind, tuple[Finish, float]]:
    """Finish and usual height of the kinds that fill an outline."""
    found = {}
    for name, entry in load_table("simbev_ros.assets.street", "solids.yaml").items():
        finish = Finish(Material[entry["material"]], Tag[entry["tag"]], rgb(int(entry["color"])))
        found[ObjectKind(name)] = finish, float(entry["height_m"])
    return found
