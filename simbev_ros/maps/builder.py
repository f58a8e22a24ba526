"""Builds the road network of a map, from the recipe of a town or from a map file, and writes it to a folder."""

import bz2
import logging
import shutil
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

from simbev_ros.config.map_files import suffix_of
from simbev_ros.foundation.errors import InputError, SimulationError, foreign_content
from simbev_ros.maps.findings import WALKED_VERGES, Finding, Outcome, sentences_of
from simbev_ros.maps.lanelet2.importer import import_lanelet2
from simbev_ros.maps.lanelet2.reader import has_lanelets
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.object_clearance import clear_carriageways
from simbev_ros.maps.opendrive.importer import import_opendrive
from simbev_ros.maps.osm.importer import import_osm
from simbev_ros.maps.parts import MapParts
from simbev_ros.maps.plan.town import build_town
from simbev_ros.maps.recipe import recipe_of
from simbev_ros.maps.roads.levels import assign_levels
from simbev_ros.maps.signals import place_signals, shown_links, with_net_ids
from simbev_ros.maps.signs import place_signs
from simbev_ros.maps.source import file_of, is_street_map
from simbev_ros.maps.store import NET, OPENDRIVE, SOURCE, write_network
from simbev_ros.maps.sumo.importer import import_sumo
from simbev_ros.maps.sumo.layout import layout_of
from simbev_ros.maps.sumo.net import SumoNet, read_sumo_net
from simbev_ros.maps.sumo.signal_programs import hold_turns_at_red
from simbev_ros.schema.scene.map_spec import MapSpec

_IMPORTERS: dict[str, Callable[[Path, Path], MapParts]] = {".xodr": import_opendrive, ".net": import_sumo}
"""Importers by the first of a file's suffixes, apart from OpenStreetMap's."""


def build_map(spec: MapSpec, folder: Path) -> None:
    """Build a map and fill an empty folder with it, as ``maps.store`` reads it.

    Args:
        spec: The map to build.
        folder: Receives the network, SUMO's net, the OpenDRIVE file and, for an imported map, its source.

    Raises:
        InputError: No map has this name, or its file is missing, changed or invalid.
        SimulationError: SUMO could not build the map.
    """
    work = folder / "work"
    work.mkdir()
    parts = _parts_of(spec, work)
    if spec.path:
        (folder / SOURCE).write_bytes(bz2.compress((parts.extract or file_of(spec)).read_bytes()))
    for source, name in ((parts.net, NET), (parts.opendrive, OPENDRIVE)):
        shutil.copyfile(source, folder / name)
    net = _read_net(spec, folder / NET)
    layout = assign_levels(parts.layout or layout_of(net), parts.features.water)
    signals = place_signals(net, layout)
    text = (folder / NET).read_text(encoding="utf-8")
    held = hold_turns_at_red(text, net.links, shown_links(net, layout))
    (folder / NET).write_text(held, encoding="utf-8")
    objects, changes = clear_carriageways(parts.features.objects, layout)
    findings = (*parts.findings, *changes)
    if net.verges:
        findings = (*findings, Finding(WALKED_VERGES, Outcome.ASSUMED))
    if held != text and spec.path:
        findings = (*findings, Finding("turns that go while the light of their lane is red wait", Outcome.REPAIRED))
    for note in sentences_of(spec.name, findings):
        logging.getLogger(__name__).info("map %s: %s", spec.name, note)
    network = RoadNetwork(
        name=spec.name,
        lanes=net.lanes,
        junctions=net.junctions,
        signals=with_net_ids(signals) if parts.opendrive_of_net else signals,
        datum=parts.datum,
        net_path=folder / NET,
        opendrive_path=folder / OPENDRIVE,
        layout=layout if layout.signs else replace(layout, signs=place_signs(net, layout)),
        features=replace(parts.features, objects=objects),
        seed=spec.seed,
        findings=findings,
        origin_m=parts.origin_m,
    )
    write_network(network, folder)
    shutil.rmtree(work)


def _read_net(spec: MapSpec, path: Path) -> SumoNet:
    """Read the net that netconvert made; with some invalid maps, it writes what nobody can read."""
    try:
        return read_sumo_net(path)
    except SimulationError as error:
        if not spec.path:
            raise
        raise InputError(f"{spec.path}: netconvert made a net of it that cannot be read ({error})") from None


def _parts_of(spec: MapSpec, work: Path) -> MapParts:
    """Plan a town or import a map's file; intermediate files go to the work folder."""
    if spec.path:
        path, suffix = file_of(spec), suffix_of(spec.path)
        importer: Callable[[Path, Path], MapParts]
        if has_lanelets(path, suffix):
            if spec.bounds is not None:
                raise InputError(f"bounds: only OpenStreetMap files have parts that can be chosen; {path} has lanelets")
            importer = import_lanelet2
        elif is_street_map(suffix):
            importer = partial(import_osm, bounds=spec.bounds)
        else:
            importer = _IMPORTERS[Path(f"map{suffix}").suffixes[0]]
        with foreign_content(path):
            return importer(path, work)
    return build_town(recipe_of(spec.name), spec.seed, work)
