"""Writes and reads RoadNetworks on disk: the SUMO net, the OpenDRIVE file, and a file of flat arrays for the rest."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from simbev_ros.foundation.errors import NPZ_DAMAGE
from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.foundation.process_limits import is_shortage
from simbev_ros.foundation.types import AnyArray
from simbev_ros.maps.columns import from_columns, part_of, to_columns
from simbev_ros.maps.findings import Finding
from simbev_ros.maps.land_features import Footprint, MapFeatures, MapObject, SpeedBump, Water, Zone
from simbev_ros.maps.network import Junction, Lane, RoadNetwork, Signal
from simbev_ros.maps.roads.layout import Crosswalk, Layout, Sign, SignalPlace, StopLine, Strip
from simbev_ros.maps.roads.tunnels import Tunnels
from simbev_ros.maps.surroundings import ReliefRecipe, SurroundingsRecipe

NET = "map.net.xml"
OPENDRIVE = "map.xodr"
SOURCE = "source.bz2"
"""Compressed with bzip2, which has one implementation: the same bytes on every machine, unlike zlib's."""
_STORE = "network.npz"
_HEADER = "header"


def write_network(network: RoadNetwork, folder: Path) -> None:
    """Write a network into a folder that already contains the files ``NET`` and ``OPENDRIVE``."""
    header = {
        "name": network.name,
        "datum": asdict(network.datum),
        "origin_m": network.origin_m,
        "corner_radius_m": network.layout.corner_radius_m,
        "surroundings": network.features.surroundings.model_dump_json(),
        "relief": network.features.relief.model_dump_json(),
        "invents_buildings": network.features.buildings is None,
        "bytes": {name: (folder / name).stat().st_size for name in (NET, OPENDRIVE)},
    }
    columns = {
        f"{name}.{column}": array
        for name, (kind, items) in _tables(network).items()
        for column, array in to_columns(kind, items).items()
    }
    columns[_HEADER] = np.frombuffer(json.dumps(header).encode(), np.uint8)
    np.savez(folder / _STORE, allow_pickle=False, **columns)


def read_network(folder: Path, seed: int) -> RoadNetwork:
    """Read a network from the folder that ``write_network`` wrote.

    Args:
        folder: Folder that it was written to.
        seed: Random seed for everything that the map does not prescribe.

    Raises:
        ValueError: The folder is damaged.
    """
    with _damage_as_value_error(folder):
        with _arrays(folder) as arrays:
            header, columns = _header(arrays), {name: arrays[name] for name in arrays.files}
        if any((folder / name).stat().st_size != count for name, count in header["bytes"].items()):
            raise ValueError("the length of a file differs from when it was written")
        return _network(folder, header, columns, seed)


def read_datum(folder: Path) -> MapDatum:
    """Read only the geodetic datum of a stored map; raises as ``read_network``."""
    with _damage_as_value_error(folder), _arrays(folder) as arrays:
        return MapDatum(**_header(arrays)["datum"])


def read_tunnels(folder: Path) -> Tunnels:
    """Read only the tunnels of a stored map; raises as ``read_network``. Quick for a map that has none."""
    with _damage_as_value_error(folder), _arrays(folder) as arrays:
        if not any(name.startswith("strips.tunnel.") for name in arrays.files):
            return Tunnels.none()
        columns = {name: arrays[name] for name in arrays.files if name.startswith("strips.")}
        strips = tuple(from_columns(Strip, part_of(columns, "strips")))
        return Tunnels.of_layout(Layout(strips, (), (), ()))


def read_source(folder: Path) -> bytes:
    """Read only the compressed file that a stored map was made from; raises as ``read_network``."""
    with _damage_as_value_error(folder):
        return (folder / SOURCE).read_bytes()


@contextmanager
def _arrays(folder: Path) -> Iterator[Any]:
    """Open the file of arrays."""
    with (folder / _STORE).open("rb") as stream, np.load(stream, allow_pickle=False) as arrays:
        yield arrays


@contextmanager
def _damage_as_value_error(folder: Path) -> Iterator[None]:
    """Convert every error that a damaged folder can cause to one ValueError."""
    try:
        yield
    except NPZ_DAMAGE as error:
        if is_shortage(error):
            raise
        raise ValueError(f"{folder}: {error}") from error


def _header(arrays: Mapping[str, AnyArray]) -> dict[str, Any]:
    return json.loads(arrays[_HEADER].tobytes())


def _tables(network: RoadNetwork) -> dict[str, tuple[type, Any]]:
    """Table name → type and instances, for everything that is stored as columns."""
    layout, features = network.layout, network.features
    return {
        "lanes": (Lane, tuple(network.lanes.values())),
        "junctions": (Junction, tuple(network.junctions.values())),
        "signals": (Signal, network.signals),
        "strips": (Strip, layout.strips),
        "crosswalks": (Crosswalk, layout.crosswalks),
        "stop_lines": (StopLine, layout.stop_lines),
        "signs": (Sign, layout.signs),
        "signal_places": (SignalPlace, layout.signal_places),
        "zones": (Zone, features.zones),
        "water": (Water, features.water),
        "buildings": (Footprint, features.buildings or ()),
        "objects": (MapObject, features.objects),
        "speed_bumps": (SpeedBump, features.speed_bumps),
        "findings": (Finding, network.findings),
    }


def _network(folder: Path, header: Mapping[str, Any], columns: Mapping[str, AnyArray], seed: int) -> RoadNetwork:
    def table(name: str, kind: type) -> tuple[Any, ...]:
        return tuple(from_columns(kind, part_of(columns, name)))

    return RoadNetwork(
        name=header["name"],
        lanes={lane.id: lane for lane in table("lanes", Lane)},
        junctions={junction.id: junction for junction in table("junctions", Junction)},
        signals=table("signals", Signal),
        datum=MapDatum(**header["datum"]),
        origin_m=tuple(header["origin_m"]),
        net_path=folder / NET,
        opendrive_path=folder / OPENDRIVE,
        layout=Layout(
            strips=table("strips", Strip),
            crosswalks=table("crosswalks", Crosswalk),
            stop_lines=table("stop_lines", StopLine),
            signs=table("signs", Sign),
            signal_places=table("signal_places", SignalPlace),
            corner_radius_m=header["corner_radius_m"],
        ),
        features=MapFeatures(
            surroundings=SurroundingsRecipe.model_validate_json(header["surroundings"]),
            zones=table("zones", Zone),
            relief=ReliefRecipe.model_validate_json(header["relief"]),
            water=table("water", Water),
            buildings=None if header["invents_buildings"] else table("buildings", Footprint),
            objects=table("objects", MapObject),
            speed_bumps=table("speed_bumps", SpeedBump),
        ),
        seed=seed,
        findings=table("findings", Finding),
    )
