"""Reads scenarios in ASAM OpenSCENARIO XML 1.0 to 1.3: a file in, its model and a document without references out.

The document is OpenSCENARIO XML 1.3 without parameters in attributes, expressions, catalogs, selections of entities and
deprecated forms, so it needs no other file but the map. Everything that a file asks for and that is not supported is
named with its place before anything starts.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, indent, tostring

from simbev_ros.config.map_files import expand_home, suffix_of
from simbev_ros.foundation.errors import InputError, foreign_content
from simbev_ros.foundation.files.input_file import is_file
from simbev_ros.foundation.files.limits import MAX_SCENARIO_ELEMENTS
from simbev_ros.maps.safe_xml import line_of, parse_text
from simbev_ros.scene.storyboard import model
from simbev_ros.scene.storyboard.model import ELEMENTS, ROOT, SPECS, TABLE, FieldSpec
from simbev_ros.scene.storyboard.parameters import Value, read_value
from simbev_ros.scene.storyboard.problems import Problems, listed
from simbev_ros.scene.storyboard.references import check_references
from simbev_ros.scene.storyboard.resolving import ResolvedElement, Resolver
from simbev_ros.schema.scene.storyboard_spec import MAX_DOCUMENT_CHARS


@dataclass(frozen=True, slots=True)
class ResolvedScenario:
    """A scenario that refers to nothing but its map.

    Attributes:
        scenario: The model.
        document: The resolved document, which ``read_resolved`` reads.
        map_name: Absolute path of the road network's file, or a name that is not that of a map's file; None if the
            scenario has no road network.
        notes: What is read in another way than it is written.
    """

    scenario: model.Element
    document: str
    map_name: str | None
    notes: tuple[str, ...] = ()


def resolve(path: Path, values: Mapping[str, Value] | None = None) -> ResolvedScenario:
    """Read a scenario's file with the catalogs that it refers to.

    Args:
        path: The file.
        values: Values of parameters of the scenario in place of the declared ones. A float is rounded for an integer
            parameter.

    Raises:
        InputError: A file cannot be read, is not valid, or asks for something that is not supported. The message has
            a line for each problem.
    """
    problems = Problems()
    with foreign_content(path):
        resolver = Resolver(path, values or {}, problems)
        root = resolver.resolve()
        scenario = _read_scenario(root, problems)
        map_name = _map_name(path, scenario, problems)
        problems.raise_any()
        indent(root)
        document = tostring(root, encoding="unicode")
        if len(document) > MAX_DOCUMENT_CHARS:
            raise InputError(f"{path}: with its catalogs it has more than {MAX_DOCUMENT_CHARS:,} characters")
        return ResolvedScenario(scenario, document, map_name, (*resolver.notes, *_remarks(scenario)))


def read_resolved(text: str) -> model.Element:
    """The model of a resolved document.

    Raises:
        InputError: It is not the document of a scenario.
    """
    problems = Problems()
    with foreign_content(_DOCUMENT):
        root = parse_text(text, ROOT, _DOCUMENT, MAX_SCENARIO_ELEMENTS)
        scenario = _read_scenario(root, problems)
        problems.raise_any()
        return scenario


def _remarks(scenario: model.Element) -> Iterator[str]:
    """What the table of elements says of them, once each."""
    told = set()
    for element in model.elements_in(scenario):
        for kinds, name, values, words in TABLE["remarks"]:
            if element.kind in kinds and (not values or getattr(element, name) in values):
                attribute = next(spec.attribute for spec in SPECS[element.kind] if spec.name == name)
                remark = f"<{element.kind} {attribute}={str(getattr(element, name))!r:.80}>: {words}"
                if remark not in told:
                    yield f"line {element.origin.rpartition(':')[2]}: {remark}"
                told.add(remark)


_DOCUMENT = "the scenario's document"


def _read_scenario(root: Element, problems: Problems) -> model.Element:
    """The model of a resolved tree, whose references have been checked if there are no other problems."""
    scenario = read_element(root, "Scenario", problems)
    if not problems:
        check_references(scenario, problems)
    return scenario


def _map_name(path: Path, scenario: model.Element, problems: Problems) -> str | None:
    """See ``ResolvedScenario.map_name``."""
    if problems or scenario.road_network.logic_file is None or not scenario.road_network.logic_file.filepath:
        return None
    name = scenario.road_network.logic_file.filepath
    if not suffix_of(name):
        return str(name)
    file = (path.parent / expand_home(name)).resolve()
    if not is_file(file):
        problems.add(scenario.road_network.logic_file.origin, f"no such file: {file}")
    return str(file)


def read_element(source: Element, kind: str, problems: Problems) -> model.Element:
    """The model of an element and of all that is in it, which is complete if there are no problems.

    Args:
        source: A resolved element.
        kind: Name of its class.
        problems: Receives what is missing, unknown, or not a value of its field.
    """
    place, attributes, children = _place(source), dict(source.attrib), list(_children(source))
    values: dict[str, Any] = dict.fromkeys((spec.name for spec in SPECS[kind]), None)
    counts: list[tuple[FieldSpec, int]] = []
    for spec in SPECS[kind]:
        if spec.attribute:
            with problems.noted(place, f"{source.tag}.{spec.attribute}"):
                values[spec.name] = _attribute(spec, attributes.pop(spec.attribute, None))
            continue
        inside = children
        if spec.wrapper:
            inside = [part for child in children if child.tag == spec.wrapper for part in _children(child)]
        parts = tuple(read_element(part, spec.kinds[part.tag], problems) for part in inside if part.tag in spec.kinds)
        values[spec.name] = parts if spec.is_tuple else next(iter(parts), None)
        children = [
            child for child in children if child.tag != spec.wrapper and (spec.wrapper or child.tag not in spec.kinds)
        ]
        counts.append((spec, len(parts)))
    unknown = [child for child in children if child.tag not in TABLE["ignored"]]
    _note_unknown(source, kind, unknown, attributes, problems)
    for spec, count in counts:
        if (count < spec.minimum and not unknown) or (count > 1 and not spec.is_tuple):
            number = f"at least {spec.minimum}" if spec.is_tuple else "1"
            names = spec.wrapper or " or ".join(spec.kinds)
            problems.add(place, f"<{source.tag}> must have {number} of {names}, not {count}")
    return ELEMENTS[kind](**values, origin=place)


def _note_unknown(
    source: Element, kind: str, children: Sequence[Element], attributes: Iterable[str], problems: Problems
) -> None:
    """Note the children and attributes of an element that no field holds."""
    tags = [tag for spec in SPECS[kind] for tag in ([spec.wrapper] if spec.wrapper else spec.kinds)]
    names = [spec.attribute for spec in SPECS[kind] if spec.attribute]
    for child in children:
        if child.tag == "CatalogReference":
            continue  # to no entry, which has been noted
        words = f"<{child.tag:.80}> in <{source.tag}> is not supported{listed(child.tag, tags, 'supported')}"
        problems.add(_place(child), words)
    for name in attributes:
        problems.add(_place(source), f"{source.tag}.{name:.80} is not an attribute that is read{listed(name, names)}")


def _attribute(spec: FieldSpec, text: str | None) -> Any:
    """The value of an attribute; raises ValueError if it has none."""
    if text is None or (spec.default is None and text.upper() in ("INF", "INFINITY")):
        if spec.default is MISSING:
            raise ValueError("is missing")
        return spec.default
    if isinstance(spec.type, list):
        if text not in spec.type:
            raise ValueError(f"is {text!r:.80}{listed(text, spec.type)}")
        return text
    return read_value(spec.type, text)


def _children(source: Element) -> Iterator[Element]:
    """The children of an element, those in elements that only group others included."""
    for child in source:
        if child.tag in TABLE["groups"]:
            yield from _children(child)
        else:
            yield child


def _place(source: Element) -> str:
    """Where an element comes from: a file of the user, or the resolved document."""
    return source.origin if isinstance(source, ResolvedElement) else f"{_DOCUMENT}:{line_of(source)}"
