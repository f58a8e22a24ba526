"""Loader of configuration files: reads YAML, resolves rigs and maps, and validates the result as a ``Scenario``.

Every error names file, line, field, value and what is allowed.
"""

import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from simbev_ros.config.base import FieldError, Keys, dotted_path, meant, short_repr
from simbev_ros.config.map_files import MAP_SUFFIXES, expand_home
from simbev_ros.config.origins import Origins
from simbev_ros.config.paths import shipped_config_dir
from simbev_ros.config.rig import SENSOR_KINDS
from simbev_ros.config.scenario import Scenario
from simbev_ros.config.yaml_file import YamlFile
from simbev_ros.foundation.errors import InputError, foreign_content
from simbev_ros.foundation.files.input_file import is_file, path_exists
from simbev_ros.foundation.files.limits import MAX_YAML_BYTES

CONFIG_SUFFIXES = (".yaml", ".yml")
"""Suffixes of files that configurations name, or that others ask for: messages about any other file would quote it."""
SCENARIO_SUFFIX = ".xosc"
"""Suffix of OpenSCENARIO files, which are configurations too: with the rest as in ``config/openscenario/run.yaml``."""


def load_scenario(path_or_name: str | Path) -> Scenario:
    """Load the configuration at a path, or the shipped one with that name, such as ``demo``; or a scenario alone.

    Raises:
        InputError: There is no such file, or it is invalid.
    """
    path = find_config(path_or_name)
    with foreign_content(path):
        if path.suffix.lower() == SCENARIO_SUFFIX:
            return _read(YamlFile(shipped_config_dir() / "openscenario" / "run.yaml"), [str(path.resolve())])
        return _read(YamlFile(path))


def parse_scenario(text: str, name: str) -> Scenario:
    """Read a configuration from YAML text; files that it names are relative to the current folder.

    Args:
        text: The configuration.
        name: What messages call it.

    Raises:
        InputError: It is too long, or invalid.
    """
    if len(text.encode(errors="replace")) > MAX_YAML_BYTES:
        raise InputError(f"{name}: is longer than {MAX_YAML_BYTES >> 20} MiB")
    with foreign_content(name):
        return _read(YamlFile(Path(name), text))


def _read(file: YamlFile, scenarios: Sequence[str] = ()) -> Scenario:
    data = file.data
    if not isinstance(data, dict):
        raise InputError(f"{file.path}: must be a mapping of sections, not {short_repr(data)}")
    data = {**data, "scenarios": [*scenarios]} if scenarios else data
    origins = Origins(file)
    data = _with_rigs(_with_absolute_maps(data, file), origins)
    return _validate(_with_first_agent(data, origins), origins)


def find_config(path_or_name: str | Path) -> Path:
    """Path of a configuration file: the given path if it exists, else the shipped configuration with that name.

    Raises:
        InputError: There is no such file.
    """
    path = Path(path_or_name)
    shipped = {file.stem: file for file in sorted(shipped_config_dir().glob("*.yaml"))}
    if is_file(path):
        return path
    if str(path_or_name) in shipped:  # also where a folder has this name, such as out/demo
        return shipped[str(path_or_name)]
    if path_exists(path):
        raise InputError(f"{path}: is not a file")
    raise InputError(f"{path}: no such file; shipped configurations are {', '.join(shipped)}")


def _with_rigs(data: dict[str, Any], origins: Origins) -> dict[str, Any]:
    """Copy of the data with the rigs of all agents as mappings, which files of their own may hold."""
    data, agents = _with_rig(data, (), origins), data.get("agents")
    if not isinstance(agents, list):
        return data
    entries = [
        _with_rig(entry, ("agents", index), origins) if isinstance(entry, dict) else entry
        for index, entry in enumerate(agents)
    ]
    return {**data, "agents": entries}


def _with_rig(agent: dict[str, Any], keys: Keys, origins: Origins) -> dict[str, Any]:
    """Copy of an agent's data with its rig as a mapping."""
    rig, keys = agent.get("rig"), (*keys, "rig")
    if rig is None:
        return agent
    if isinstance(rig, str):
        path = _find_rig(rig, origins.where(keys), origins.file.path)
        rig_file = next((file for file in origins.rig_files.values() if file.path == path), None) or YamlFile(path)
        origins.rig_files[keys] = rig_file
        rig = rig_file.data
    return {**agent, "rig": _expanded_rig(rig, keys, origins)}


def _expanded_rig(data: Any, keys: Keys, origins: Origins) -> Any:
    """Copy of a rig's data in which its ``defaults`` (by sensor type) are written into each sensor."""
    if not isinstance(data, dict) or "defaults" not in data:
        return data
    data, where = dict(data), origins.where((*keys, "defaults"))
    defaults = data.pop("defaults")
    if not isinstance(defaults, dict) or not all(isinstance(entry, dict) for entry in defaults.values()):
        raise InputError(f"{where}: must map sensor types to properties")
    sensors = data.get("sensors")
    if isinstance(sensors, list):
        types = [sensor.get("type") for sensor in sensors if isinstance(sensor, dict)]
        unused = [kind for kind in defaults if kind not in types]
        if unused:
            words = f"no sensor of type {', '.join(map(str, unused))} is in the rig"
            raise InputError(f"{where}: {words}{meant(unused[0], SENSOR_KINDS).rstrip(';')}")
        data["sensors"] = [
            {**defaults.get(str(sensor.get("type")), {}), **sensor} if isinstance(sensor, dict) else sensor
            for sensor in sensors
        ]
    return data


def _with_first_agent(data: dict[str, Any], origins: Origins) -> dict[str, Any]:
    """Copy of data without ``rig``: the first vehicle of ``agents`` becomes the sections of the first agent."""
    agents = data.get("agents")
    if "rig" in data or not (isinstance(agents, list) and agents):
        return data
    index = next((index for index, agent in enumerate(agents) if not _has_mast(agent)), None)
    if index is None:
        raise InputError(f"{origins.where(('agents',))}: all agents have a mast; at least one must be a vehicle")
    if not isinstance(agents[index], dict):
        return data
    first, others = dict(agents[index]), [number for number in range(len(agents)) if number != index]
    if "name" not in first:
        raise InputError(f"{origins.where(('agents', index, 'name'))}: is missing")
    name = first.pop("name")
    for key in ("count", "near", "arrangement", "carrier"):
        if first.pop(key, None) is not None:
            raise InputError(f"{origins.where(('agents', index, key))}: only agents after the first one can have it")
    sections = {key: first.pop(key, None) for key in ("rig", "frames", "annotation", "evaluation")} | {"ego": first}
    sections = {key: section for key, section in sections.items() if section is not None}
    for key in sections:
        if key in data:
            raise InputError(f"{origins.where((key,))}: leave it out; agents[{index}] describes the first agent")
    if isinstance(sections.get("rig"), dict):
        sections["rig"] = {**sections["rig"], "agent": name}
    origins.moved = {
        **{(key,): ("agents", index, key) for key in ("rig", *sections)},
        ("rig", "agent"): ("agents", index, "name"),
        ("ego",): ("agents", index),
        **{("agents", position): ("agents", number) for position, number in enumerate(others)},
    }
    return {**data, **sections, "agents": [agents[number] for number in others]}


def _has_mast(agent: Any) -> bool:
    """Whether an entry of ``agents`` is a roadside unit."""
    return isinstance(agent, dict) and agent.get("mast") is not None


def _with_absolute_maps(data: dict[str, Any], file: YamlFile) -> dict[str, Any]:
    """Copy of the data with absolute paths of map files and scenarios, which are relative to its folder."""

    def absolute(name: str, *keys: str | int) -> str:
        path = file.path.parent / expand_home(name)
        if not is_file(path):
            raise InputError(f"{file.path}:{file.line_of(list(keys))}: {dotted_path(keys)}: no such file: {path}")
        return str(path.resolve())

    def is_path(name: Any, key: str) -> bool:
        return isinstance(name, str) and (key != "map" or name.lower().endswith(MAP_SUFFIXES))

    if isinstance(scenarios := data.get("scenarios"), list):
        named = [absolute(each, "scenarios", k) if is_path(each, "") else each for k, each in enumerate(scenarios)]
        data = {**data, "scenarios": named}
    if not isinstance(scenes := data.get("scenes"), list):
        return data
    entries = [
        {
            key: absolute(value, "scenes", index, key) if key in ("map", "scenario") and is_path(value, key) else value
            for key, value in entry.items()
        }
        if isinstance(entry, dict)
        else entry
        for index, entry in enumerate(scenes)
    ]
    return {**data, "scenes": entries}


def _find_rig(name: str, where: str, config_path: Path) -> Path:
    """Path of a rig's file; ``where`` begins the messages."""
    if Path(name).suffix not in CONFIG_SUFFIXES:
        raise InputError(f"{where}: must be a file that ends in {' or '.join(CONFIG_SUFFIXES)}, not {name!r}")
    candidates = [config_path.parent / name, shipped_config_dir() / name]
    for candidate in candidates:
        if is_file(candidate):
            return candidate
    raise InputError(f"{where}: no such file: {candidates[0]}")


def _validate(data: dict[str, Any], origins: Origins) -> Scenario:
    try:
        scenario = Scenario.model_validate(data)
    except ValidationError as error:
        entries = _deepest_errors(error.errors(), data)
        lines = [_explain(entry, data, origins) for entry in entries[:_MAX_ERRORS]]
        if len(entries) > _MAX_ERRORS:
            lines.append(f"{origins.file.path}: and {len(entries) - _MAX_ERRORS:,} more errors")
        raise InputError("\n".join(dict.fromkeys(lines))) from None
    scenario.origins.update(origins.of_scenes_and_agents(data))
    return scenario


_QUOTED = r"'([^']*)'"
_MAX_ERRORS = 50
"""Number of errors that are explained."""


def _deepest_errors(entries: Sequence[Any], data: Any) -> list[Any]:
    """Pydantic's errors without those that are mere consequences of an error in a nested value."""
    locations = [tuple(_keys_in_data(entry["loc"], data)) for entry in entries]
    above = {location[:depth] for location in locations for depth in range(len(location))}
    return [entry for entry, location in zip(entries, locations, strict=True) if location not in above]


def _explain(entry: Any, data: Any, origins: Origins) -> str:
    """Line of text that explains an error from pydantic."""
    keys = _keys_in_data(entry["loc"], data)
    message = entry["msg"].removeprefix("Value error, ")
    if isinstance(error := entry.get("ctx", {}).get("error"), FieldError):
        keys, message = [*keys, *error.keys], error.problem
    elif entry["type"] == "extra_forbidden":
        message = f"unknown key{_suggestion(str(keys[-1]), origins.in_file(entry['loc']))}"
    elif entry["type"] in ("union_tag_invalid", "union_tag_not_found"):
        keys, kind = [*keys, "type"], entry.get("ctx", {}).get("tag")
        problem = "is missing;" if kind is None else f"{kind!r:.80} is not known{meant(kind, SENSOR_KINDS)}"
        message = f"{problem} allowed: {', '.join(SENSOR_KINDS)}"
    elif entry["type"] == "literal_error" and isinstance(entry["input"], str):
        expected = entry["ctx"]["expected"]
        problem = f"{short_repr(entry['input'])} is not known{meant(entry['input'], re.findall(_QUOTED, expected))}"
        message = f"{problem} allowed: {expected}"
    elif entry["type"] == "missing":
        message = "is missing"
    elif entry["type"] == "too_short":
        message = f"must have at least {entry['ctx']['min_length']} items, not {entry['ctx']['actual_length']}"
    elif entry["type"] == "too_long":
        message = f"must have at most {entry['ctx']['max_length']} items, not {entry['ctx']['actual_length']}"
    elif entry["type"] != "value_error":
        message = f"{message}, not {short_repr(entry['input'])}"
    return f"{origins.where(keys)}: {message}"


def _keys_in_data(location: Sequence[str | int], data: Any) -> list[str | int]:
    """Keys of pydantic's location, without the names of union branches, which are not in the file."""
    keys: list[str | int] = []
    for index, key in enumerate(location):
        last = index == len(location) - 1
        if isinstance(data, dict) and (key in data or (last and isinstance(key, str) and key not in _BRANCHES)):
            data = data.get(key)
        elif isinstance(data, (list, tuple)) and isinstance(key, int) and key < len(data):
            data = data[key]
        else:
            continue
        keys.append(key)
    return keys


_BRANCHES = {"number", "distribution", "options", "paper", "poses", "poses_by_map", *SENSOR_KINDS}


def _suggestion(key: str, location: Sequence[str | int]) -> str:
    allowed = _allowed_keys(Scenario, location[:-1])
    return f"{meant(key, allowed)} allowed: {', '.join(allowed)}" if allowed else ""


def _allowed_keys(model: type[BaseModel], location: Sequence[str | int]) -> list[str]:
    """Field names of the model at one of pydantic's locations."""
    schema = _schema_of(model)
    node: Any = schema
    for key in location:
        node = _resolve(node, schema)
        branches = [node, *node.get("oneOf", ())]
        if isinstance(key, int):
            node = next((branch["items"] for branch in branches if "items" in branch), {})
        elif key in ("poses", "poses_by_map"):
            continue
        elif key in node.get("properties", {}):
            node = node["properties"][key]
        elif "discriminator" in node and key in node["discriminator"].get("mapping", {}):
            node = {"$ref": node["discriminator"]["mapping"][key]}
        else:
            by_name = [branch["additionalProperties"] for branch in branches if branch.get("additionalProperties")]
            node = by_name[0] if by_name else _model_branch(node)
    node = _resolve(node, schema)
    return list(_resolve(_model_branch(node) if "anyOf" in node else node, schema).get("properties", {}))


@cache
def _schema_of(model: type[BaseModel]) -> Any:
    return model.model_json_schema()


def _model_branch(node: Any) -> Any:
    """Schema of the model among a union's alternatives."""
    return next((branch for branch in node.get("anyOf", node.get("oneOf", [])) if "$ref" in branch), {})


def _resolve(node: Any, schema: Any) -> Any:
    while "$ref" in node:
        node = schema["$defs"][node["$ref"].rsplit("/", 1)[1]]
    return node
