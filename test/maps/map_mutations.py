"""Mutates valid maps as editors and converters damage them, and builds what comes of it.

Points are nudged, elements dropped, duplicated or split, sequences reversed, values scaled, shapes made to cross
themselves.
"""

import collections
import copy
import random
import tempfile
from collections.abc import Callable
from pathlib import Path
from xml.etree.ElementTree import Element, ElementTree, fromstring

from simbev_ros.assets.regions.build import build_region
from simbev_ros.assets.regions.far_land import far_land
from simbev_ros.foundation.errors import InputError
from simbev_ros.maps.build import load_network
from simbev_ros.maps.land.terrain import Terrain
from simbev_ros.maps.region import regions_of
from simbev_ros.maps.source import map_spec

_MAX_STEPS = 4
_MAX_REGIONS = 2
_DEGREES_PER_M = 1e-5
_FACTORS = (0.0, -1.0, 1e-6, 0.1, 0.5, 0.999999, 2.0, 10.0, 1e3)


def mutated(text: str, seed: int) -> bytes:
    """A map with one to four mutations."""
    root, rng = fromstring(text), random.Random(seed)
    for _ in range(rng.randint(1, _MAX_STEPS)):
        rng.choice(_STEPS)(root, rng)
    with tempfile.TemporaryFile() as stream:
        ElementTree(root).write(stream, encoding="utf-8")
        stream.seek(0)
        return stream.read()


def build_everything(path: Path, cache_dir: Path) -> bool:
    """Build the roads of a map and up to two of its regions; whether it opens.

    Any exception other than an InputError is a find.
    """
    spec = map_spec(str(path))
    try:
        network = load_network(spec, cache_dir)
    except InputError as error:
        assert "\n" not in str(error)
        return False
    terrain = Terrain(network)
    regions = regions_of(network.layout)
    for region in regions[:: max(len(regions) // _MAX_REGIONS, 1)][:_MAX_REGIONS]:
        build_region(network, region, terrain)
    far_land(network, terrain)
    return True


def _nudge(root: Element, rng: random.Random) -> None:
    """Move a point, or change another number, a little or a lot."""
    element = _pick(root, rng, _has_numbers)
    if element is None:
        return
    amount_m = rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-6.0, 3.0)
    if element.get("shape"):
        points = _points(element)
        points[rng.randrange(len(points))][rng.randrange(2)] += amount_m
        _set_points(element, points)
        return
    name = rng.choice(_numeric(element))
    scale = _DEGREES_PER_M if name in ("lat", "lon") else 1.0
    element.set(name, repr(float(element.attrib[name]) + amount_m * scale))


def _scale(root: Element, rng: random.Random) -> None:
    """Multiply a number, or the same number of all elements of the kind."""
    element = _pick(root, rng, lambda each: bool(_numeric(each)))
    if element is None:
        return
    name, factor = rng.choice(_numeric(element)), rng.choice(_FACTORS)
    for each in root.iter(element.tag) if rng.randrange(4) == 0 else [element]:
        if name in _numeric(each):
            each.set(name, repr(float(each.attrib[name]) * factor))


def _drop(root: Element, rng: random.Random) -> None:
    parent = _pick(root, rng, lambda each: len(each) > 0)
    if parent is not None and rng.randrange(3):
        parent.remove(rng.choice(list(parent)))
    elif (element := _pick(root, rng, lambda each: bool(each.attrib))) is not None:
        del element.attrib[rng.choice(sorted(element.attrib))]


def _duplicate(root: Element, rng: random.Random) -> None:
    """Repeat an element, mostly with an id of its own, or a point of a shape."""
    shaped = _pick(root, rng, lambda each: bool(each.get("shape")))
    if shaped is not None and rng.randrange(2):
        points = _points(shaped)
        index = rng.randrange(len(points))
        points[index:index] = [list(points[index])] * rng.choice([1, 1, 5])
        _set_points(shaped, points)
        return
    parent = _pick(root, rng, lambda each: len(each) > 0)
    if parent is None:
        return
    index = rng.randrange(len(parent))
    twin = copy.deepcopy(parent[index])
    if "id" in twin.attrib and rng.randrange(4):
        twin.set("id", str(900_000 + rng.randrange(90_000)))
    parent.insert(rng.randint(0, len(parent)), twin)


def _reverse(root: Element, rng: random.Random) -> None:
    """Reverse the points of a shape or the children of an element."""
    shaped = _pick(root, rng, lambda each: bool(each.get("shape")))
    if shaped is not None and rng.randrange(2):
        _set_points(shaped, _points(shaped)[::-1])
    elif (parent := _pick(root, rng, lambda each: len(each) > 1)) is not None:
        parent[:] = list(parent)[::-1]


def _cross(root: Element, rng: random.Random) -> None:
    """Exchange two points of a shape or two children of an element."""
    shaped = _pick(root, rng, lambda each: bool(each.get("shape")))
    if shaped is not None and rng.randrange(2):
        points = _points(shaped)
        i, j = rng.randrange(len(points)), rng.randrange(len(points))
        points[i], points[j] = points[j], points[i]
        _set_points(shaped, points)
    elif (parent := _pick(root, rng, lambda each: len(each) > 1)) is not None:
        i, j = rng.randrange(len(parent)), rng.randrange(len(parent))
        parent[i], parent[j] = parent[j], parent[i]


def _split(root: Element, rng: random.Random) -> None:
    """Divide an element into two, each with a part of its children or points."""
    parent = _pick(root, rng, lambda each: any(len(child) > 1 or child.get("shape") for child in each))
    if parent is None:
        return
    index = rng.choice([k for k, child in enumerate(parent) if len(child) > 1 or child.get("shape")])
    first, second = parent[index], copy.deepcopy(parent[index])
    if "id" in second.attrib:
        second.set("id", str(800_000 + rng.randrange(90_000)))
    if first.get("shape"):
        points = _points(first)
        cut = rng.randrange(len(points))
        _set_points(first, points[: cut + 1])
        _set_points(second, points[cut:])
    else:
        cut = rng.randrange(1, len(first))
        first[:], second[:] = list(first)[:cut], list(second)[cut:]
    parent.insert(index + 1, second)


_STEPS: tuple[Callable[[Element, random.Random], None], ...] = (
    *(_nudge, _nudge, _scale, _drop, _duplicate, _reverse, _cross, _split),
)


def _pick(root: Element, rng: random.Random, accepts: Callable[[Element], bool]) -> Element | None:
    """A random element of a random kind among the accepted ones, below the root."""
    by_tag = collections.defaultdict(list)
    for element in root.iter():
        if element is not root and accepts(element):
            by_tag[element.tag].append(element)
    return rng.choice(by_tag[rng.choice(sorted(by_tag))]) if by_tag else None


def _has_numbers(element: Element) -> bool:
    return bool(element.get("shape") or _numeric(element))


def _numeric(element: Element) -> list[str]:
    return sorted(name for name, value in element.attrib.items() if name not in ("id", "ref") and _is_number(value))


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _points(element: Element) -> list[list[float]]:
    return [[float(value) for value in point.split(",")] for point in element.attrib["shape"].split()]


def _set_points(element: Element, points: list[list[float]]) -> None:
    element.set("shape", " ".join(",".join(f"{value:.6f}" for value in point) for point in points))
