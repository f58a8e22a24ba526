"""Resolves a scenario's file: parameters, expressions, catalogs, deprecated forms and selections of entities.

The result is a tree of elements in which every element knows the place that it comes from.
"""

from collections import ChainMap
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

from simbev_ros.config.map_files import expand_home
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.limits import MAX_SCENARIO_BYTES, MAX_SCENARIO_ELEMENTS, MAX_XML_DEPTH
from simbev_ros.maps.safe_xml import parse, place_of
from simbev_ros.scene.storyboard.model import ROOT, TABLE
from simbev_ros.scene.storyboard.parameters import (
    Parameter,
    Scope,
    Value,
    read_declaration,
    read_value,
    substitute,
    text_of,
)
from simbev_ros.scene.storyboard.problems import Problems, listed

VERSIONS = ("1.0", "1.1", "1.2", "1.3")
"""Versions of the standard that are read."""

CATALOG_SUFFIX = ".xosc"
"""Suffix of files of catalogs: other files in a folder are not read, and no message quotes them."""

_CARLA = "CARLA:"
_CRITERIA = "conditions criteria_… of no parameter are criteria of ScenarioRunner, and never hold"

MAX_CATALOG_FILES = 1_000
"""Files of catalogs that are searched."""


class ResolvedElement(Element):
    """An element with the ``file:line`` that it comes from."""

    origin: str = ""


def parse_scenario(path: Path) -> Element:
    """Parse a file of the standard and return its root.

    Raises:
        InputError: The file cannot be read, is too large, is not XML, or its version is not read.
    """
    root = parse(path, ROOT, MAX_SCENARIO_BYTES, MAX_SCENARIO_ELEMENTS)
    header = root.find("FileHeader")
    version = "missing" if header is None else f"{header.get('revMajor')}.{header.get('revMinor')}"
    if version not in VERSIONS:
        place = place_of(path, root if header is None else header)
        raise InputError(f"{place}: the version in <FileHeader> is {version:.40}; read are {', '.join(VERSIONS)}")
    return root


class Resolver:
    """Resolves one scenario.

    Args:
        path: Its file.
        values: Values of its parameters, in place of the declared ones.
        problems: Receives what is wrong.

    Attributes:
        notes: What is read in another way than it is written, as keys.
    """

    def __init__(self, path: Path, values: Mapping[str, Value], problems: Problems) -> None:
        self._path, self._values, self._problems = path, values, problems
        self._elements = self._characters = 0
        self.notes: dict[str, None] = {}
        self._folders: list[tuple[Path, str]] = []
        self._unread: list[InputError] = []
        self._catalogs: dict[str, dict[str, tuple[Element, Path]]] | None = None

    def resolve(self) -> ResolvedElement:
        """The resolved tree; raises InputError if a file cannot be parsed."""
        source, file = parse_scenario(self._path), self._path
        scope = self._declared(source, {}, file, self._values)
        self._problems.raise_any()  # else each use of a parameter without a value would be one more
        for directory in source.iterfind("CatalogLocations/*/Directory"):
            with self._problems.noted(place_of(file, directory), "Directory.path"):
                folder = file.parent / expand_home(substitute(directory.get("path", ""), scope))
                self._folders.append((folder, place_of(file, directory)))
        root = self.resolved(source, scope, file, 0)
        for header in root.findall("FileHeader"):
            header.attrib |= {"revMajor": "1", "revMinor": "3"}
            if (description := header.get("description", "")).startswith(_CARLA):
                header.attrib["description"] = description.removeprefix(_CARLA)
                self._mirror(root)
        for declaration in root.findall("ParameterDeclarations/ParameterDeclaration"):
            name = declaration.get("name", "").removeprefix("$")
            declaration[:], declaration.attrib["name"] = [], name
            declaration.attrib["value"] = scope[name].text if name in scope else ""
        self._expand_selections(root)
        return root

    def resolved(self, source: Element, scope: Scope, file: Path, depth: int) -> ResolvedElement:
        """A resolved copy of an element of a file, with all that is in it, in a scope and at a depth."""
        place = place_of(file, source)
        if depth > MAX_XML_DEPTH:
            raise InputError(f"{place}: with its catalogs, the scenario is nested more than {MAX_XML_DEPTH} deep")
        attributes = {name: text for name, text in source.items() if ":" not in name and name != "xmlns"}
        for name, text in attributes.items() if source.tag != "ParameterDeclaration" else ():
            is_label = name == "name" and text.startswith("${")  # some add texts, which no expression can
            with suppress(ValueError) if is_label else self._problems.noted(place, f"{source.tag}.{name}"):
                attributes[name] = substitute(text, scope)
        self._require_room(1, sum(map(len, attributes.values())), place)
        copy = ResolvedElement(source.tag, self._current(source.tag, attributes, place))
        copy.origin = place
        for child in source if source.tag != "CatalogLocations" else ():
            if child.tag == "CatalogReference":
                copy.append(self._entry(child, scope, file, depth + 1))
            elif not _is_dropped(child, depth) and not self._is_criterion(child, scope):
                inner = self._declared(child, scope, file, {}) if depth else scope
                copy.append(self.resolved(child, inner, file, depth + 1))
        return copy

    def _mirror(self, root: ResolvedElement) -> None:
        """Turn coordinates and edges as CARLA's ScenarioRunner reads them into those of the standard."""
        words = "so y points to the right, and conditions without a rising edge hold too, as in ScenarioRunner"
        self.notes[f"its description begins with {_CARLA} {words}"] = None
        for element in root.iter():
            if element.get("conditionEdge") == "rising":
                element.attrib["conditionEdge"] = "none"
            for name in TABLE["mirrored"].get(element.tag, ()):
                with self._problems.noted(getattr(element, "origin", ""), f"{element.tag}.{name}"):
                    if name in element.attrib:
                        element.attrib[name] = text_of(-read_value("number", element.attrib[name]))

    def _is_criterion(self, group: Element, scope: Scope) -> bool:
        """Whether an element is a group of conditions that has a criterion of ScenarioRunner, so it never holds."""
        for condition in group.iterfind("Condition") if group.tag == "ConditionGroup" else ():
            test = condition.find("ByValueCondition/ParameterCondition")
            is_unknown = test is not None and test.get("parameterRef", "") not in scope
            if is_unknown and condition.get("name", "").startswith("criteria_"):
                self.notes[_CRITERIA] = None
                return True
        return False

    def _require_room(self, elements: int, characters: int, place: str) -> None:
        """Raise InputError if the resolved tree would become too large with more elements and characters."""
        self._elements += elements
        self._characters += characters
        if self._elements > MAX_SCENARIO_ELEMENTS or self._characters > MAX_SCENARIO_BYTES:
            limits = f"{MAX_SCENARIO_ELEMENTS:,} elements or {MAX_SCENARIO_BYTES >> 20} MiB"
            raise InputError(f"{place}: the scenario with its parameters and catalogs has more than {limits}")

    def _declared(self, source: Element, outer: Scope, file: Path, given: Mapping[str, Value]) -> Scope:
        """The scope in an element: the one around it, and the parameters that the element declares.

        Values that are given stand for the declared ones.
        """
        declarations = source.findall("ParameterDeclarations/ParameterDeclaration")
        if not declarations and not given:
            return outer
        scope = ChainMap(dict[str, Parameter](), *([outer] if outer else ()))
        names = [declaration.get("name", "").removeprefix("$") for declaration in declarations]
        for name, declaration in zip(names, declarations, strict=True):
            value = given.get(name)
            with self._problems.noted(place_of(file, declaration), f"parameter {name:.80}"):
                text = value if value is None or isinstance(value, float) else text_of(value)
                scope[name] = read_declaration(declaration, scope, text)
        for name in given.keys() - set(names):
            words = f"<{source.tag}> has no parameter {name:.80}{listed(name, names, 'declared')}"
            self._problems.add(place_of(file, source), words)
        return scope

    def _current(self, tag: str, attributes: Mapping[str, str], place: str) -> dict[str, str]:
        """Attributes in which deprecated ones and deprecated values have their present form."""
        result: dict[str, str] = {}
        for name, text in attributes.items():
            stands_for = TABLE["replaced"].get(f"{tag}.{name}") or TABLE["replaced"].get(name, {})
            new: dict[str | None, str] | None = stands_for.get(text)
            if f"{tag}.{name}" in TABLE["renamed"]:
                new_name, factor = TABLE["renamed"][f"{tag}.{name}"]
                new = {}
                with self._problems.noted(place, f"{tag}.{name}"):
                    new[new_name] = text if factor is None else text_of(read_value("number", text) * factor)
            for key, value in {name: text}.items() if new is None else new.items():
                if key is not None and (key == name or key not in attributes):
                    result[key] = value
        return result

    def _entry(self, reference: Element, scope: Scope, file: Path, depth: int) -> ResolvedElement:
        """The entry of a catalog that a reference stands for; an empty reference if there is none."""
        found = None
        with self._problems.noted(place_of(file, reference), reference.tag):
            catalog, entry = (substitute(reference.get(key, ""), scope) for key in ("catalogName", "entryName"))
            assigned: dict[str, Value] = {
                item.get("parameterRef", "").removeprefix("$"): substitute(item.get("value", ""), scope)
                for item in reference.iterfind("ParameterAssignments/ParameterAssignment")
            }
            entries = _found("catalog", catalog, self._load_catalogs())
            found = _found(f"entry of catalog {catalog:.80}", entry, entries)
        if found is None:
            for error in self._unread:
                self._problems.add(place_of(file, reference), f"it may be in a file that cannot be read: {error}")
            return ResolvedElement(reference.tag)
        source, origin = found
        return self.resolved(source, self._declared(source, {}, origin, assigned), origin, depth)

    def _load_catalogs(self) -> Mapping[str, Mapping[str, tuple[Element, Path]]]:
        """The entries of all catalogs in the folders of the scenario, with the files that they are in."""
        if self._catalogs is None:
            self._catalogs = {}
            files = [file for folder, place in self._folders for file in self._files_in(folder, place)]
            for file in list(dict.fromkeys(files))[:MAX_CATALOG_FILES]:
                try:
                    catalog = parse_scenario(file).find("Catalog")
                except InputError as error:
                    self._unread.append(error)
                    continue
                if catalog is not None:
                    entries = self._catalogs.setdefault(catalog.get("name", ""), {})
                    entries |= {entry.get("name", ""): (entry, file) for entry in catalog}
        return self._catalogs

    def _files_in(self, folder: Path, place: str) -> list[Path]:
        """The files of catalogs in a folder, which may be a file as well."""
        try:
            files = [folder] if folder.is_file() else sorted(folder.iterdir())
        except OSError as error:
            self._problems.add(place, f"cannot read the folder {folder}: {error.strerror}")
            return []
        return [file for file in files if file.suffix == CATALOG_SUFFIX and file.resolve() != self._path.resolve()]

    def _expand_selections(self, root: ResolvedElement) -> None:
        """Replace selections of entities by their members wherever entities are listed, and remove them."""
        objects = {item.get("name", ""): item for item in root.findall("Entities/ScenarioObject")}
        members: dict[str, list[str]] = {}
        for entities in root.findall("Entities"):
            for selection in entities.findall("EntitySelection"):
                self._require_room(len(objects), 0, getattr(selection, "origin", ""))
                kinds = {item.get("objectType", "") for item in selection.iter("ByType")}
                named = [item.get("entityRef", "") for item in selection.iter("EntityRef")]
                by_kind = [
                    name for name, item in objects.items() if any(_KINDS.get(part.tag) in kinds for part in item)
                ]
                members[selection.get("name", "")] = [*named, *by_kind]
                entities.remove(selection)
        for parent in list(root.iter()) if members else ():
            for index, item in reversed(list(enumerate(parent))):
                names = members.get(item.get("entityRef", ""))
                if names is not None and item.tag in ("EntityRef", "Private"):
                    place = getattr(item, "origin", "")
                    self._require_room(len(names) * sum(1 for _ in item.iter()), sum(map(len, names)), place)
                    parent[index : index + 1] = [_member(item, name, place) for name in names]


_KINDS = {"Vehicle": "vehicle", "Pedestrian": "pedestrian", "MiscObject": "miscellaneous"}


def _member(item: Element, name: str, place: str) -> ResolvedElement:
    """An element that refers to a member of a selection in place of the selection."""
    copy = ResolvedElement(item.tag, {**item.attrib, "entityRef": name})
    copy.origin = place
    copy.extend(item)
    return copy


def _found(kind: str, name: str, things: Mapping[str, Any]) -> Any:
    """The thing with a name; raises ValueError if there is none."""
    if name not in things:
        raise ValueError(f"there is no {kind} {name!r:.80}{listed(name, things, 'there are')}")
    return things[name]


def _is_dropped(element: Element, depth: int) -> bool:
    """Whether an element is not in a resolved tree.

    Declarations are not, except for the scenario's, nor are actions that override nothing, which version 1.0 demands.
    """
    if element.tag == "OverrideControllerValueAction":
        return all(part.get("active") in ("false", "0") for part in element)
    return element.tag == "ParameterDeclarations" and depth > 0
