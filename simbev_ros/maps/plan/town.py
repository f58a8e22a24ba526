"""Builds a town: takes its recipe and a seed, and returns the parts of a map."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import shapely

from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.findings import Finding, Outcome
from simbev_ros.maps.land.relief import Relief
from simbev_ros.maps.land_features import MapFeatures, Water
from simbev_ros.maps.parts import MapParts
from simbev_ros.maps.plan.draft import Draft
from simbev_ros.maps.plan.heights.profile import Land, add_heights
from simbev_ros.maps.plan.heights.structures import split_structures
from simbev_ros.maps.plan.land import water_area, waters_of, zones_of
from simbev_ros.maps.plan.noding import divide_draft
from simbev_ros.maps.plan.patterns.pattern import draw_patterns
from simbev_ros.maps.plan.plan import Plan, half_width_m
from simbev_ros.maps.plan.sumo_xml import connections_xml, edges_xml, nodes_xml
from simbev_ros.maps.recipe import TownRecipe
from simbev_ros.maps.sumo import netconvert

_SIGNAL_RADIUS_M = 10.0
_MAX_SIGNAL_KMH = 75.0


def build_town(recipe: TownRecipe, seed: int, work: Path) -> MapParts:
    """Draw a town's plan and build it with SUMO's netconvert.

    Args:
        recipe: The town's recipe.
        seed: Random seed for everything that the recipe leaves open; the same seed gives the same bytes.
        work: An existing folder for the resulting files.

    Raises:
        InputError: The recipe's roads cannot be built.
        SimulationError: netconvert failed.
    """
    land = Relief.of(recipe.relief, seed).height_m
    draft = draw_patterns(recipe.patterns, recipe.name, seed)
    water = _waters(recipe, draft, land)
    plan = _with_verges_on_land(split_structures(add_heights(divide_draft(draft), land, water), land), water)
    is_signalized = _signalized_nodes(plan, recipe, draft.signals_m)
    nodes, edges, connections = (work / f"map.{part}.xml" for part in ("nod", "edg", "con"))
    nodes.write_text(nodes_xml(plan, is_signalized, recipe.datum.datum.proj_string), encoding="utf-8")
    edges.write_text(edges_xml(plan), encoding="utf-8")
    connections.write_text(connections_xml(plan, recipe.crossing_width_m), encoding="utf-8")
    net, opendrive = work / "map.net.xml", work / "map.xodr"
    netconvert.build_from_plain_xml(nodes, edges, connections, net, opendrive)
    findings = tuple(Finding(note, Outcome.REPAIRED) for note in plan.notes)
    return MapParts(net, opendrive, recipe.datum.datum, _features(recipe, draft, water), findings=findings)


def _features(recipe: TownRecipe, draft: Draft, water: tuple[Water, ...]) -> MapFeatures:
    zones = (*draft.zones, *zones_of(recipe.zones))
    return MapFeatures(recipe.surroundings, zones, recipe.relief, water)


def _waters(recipe: TownRecipe, draft: Draft, land: Land) -> tuple[Water, ...]:
    return (*waters_of(recipe.water, land), *(water_area(area, land) for area in draft.water))


def _with_verges_on_land(plan: Plan, waters: Sequence[Water]) -> Plan:
    """The plan without the verges of links on structures or across water."""
    links, water = [], overlay.union_all([each.area for each in waters])
    for link in plan.links:
        kind, line = link.road.kind, shapely.LineString(link.line_m[:, :2])
        if kind.verge and (link.structure or shapely.dwithin(line, water, half_width_m(kind))):
            bare = kind.model_copy(update={"verge": False, "sidewalk_m": 0.0})
            links.append(replace(link, road=replace(link.road, kind=bare)))
        else:
            links.append(link)
    return replace(plan, links=tuple(links))


def _signalized_nodes(plan: Plan, recipe: TownRecipe, requested_m: Sequence[Float64Array]) -> list[bool]:
    """(K,) whether each node has traffic lights."""
    is_signalized = []
    for node, links in enumerate(plan.links_at()):
        incoming = sum(link.road.kind.lanes for link in links if not link.road.kind.one_way or link.end == node)
        by_rule = (
            len(links) >= 3
            and incoming >= recipe.signals_from_lanes
            and all(link.road.kind.speed_kmh <= _MAX_SIGNAL_KMH for link in links)
            and not any(link.road.kind.one_way for link in links)
        )
        by_request = any(
            np.linalg.norm(plan.nodes_m[node][:2] - position_m) < _SIGNAL_RADIUS_M for position_m in requested_m
        )
        is_signalized.append(by_rule or by_request)
    return is_signalized
