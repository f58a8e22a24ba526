"""The map of a scene as Autoware loads it, from the map file in the scene's bag; this needs the simulator."""

from pathlib import Path

from simbev_exporters.recorded_roads import recorded_map
from simbev_ros.assets.regions.static_cache import StaticCache
from simbev_ros.export.maps.lanelet2_file import autoware_rise_m, lanelet2_of, projector_info
from simbev_ros.export.maps.point_map import REACH_M, point_map_of, scanners_on
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.lanelet2.projector_info import FILE_NAME
from simbev_ros.maps.region import Reach, Reaches, regions_of


def map_files(bag: Path, path_m: Float64Array) -> dict[str, bytes]:
    """Contents of the Lanelet2 file, of the points along a path, and of the file about their projection, by name.

    Args:
        bag: The scene's bag.
        path_m: (N, 3) path on the ground, map frame.

    Raises:
        BagError: The map file in the bag is damaged, or larger than a map file may be.
        InputError: The roads cannot be built from it.
    """
    spec, network = recorded_map(bag)
    scanners_m, cache = scanners_on([path_m]), StaticCache(spec, network)
    reach = Reaches(tuple(Reach((x_m, y_m), REACH_M) for x_m, y_m, _ in scanners_m.tolist()))
    with cache.building():
        regions = [cache.region(region).tiles for region in regions_of(network.layout, reach)]
    return {
        "lanelet2_map.osm": lanelet2_of(network),
        "pointcloud_map.pcd": b"".join(point_map_of(regions, scanners_m, autoware_rise_m(network.datum))),
        FILE_NAME: projector_info(network.datum),
    }
