"""Origins of a configuration's values: the file, the line and the name of each where the user wrote it."""

from collections.abc import Iterator, Sequence
from typing import Any

from simbev_ros.config.base import Keys, dotted_path
from simbev_ros.config.yaml_file import YamlFile


class Origins:
    """Where the values of a configuration come from: its file, or one of the files of rigs that it names.

    Attributes:
        file: The file of the configuration.
        rig_files: Files of rigs, by the fields of ``file`` that name them.
        moved: Fields of ``file`` that are elsewhere in the configuration, by the fields that they are there.
    """

    def __init__(self, file: YamlFile) -> None:
        self.file = file
        self.rig_files: dict[Keys, YamlFile] = {}
        self.moved: dict[Keys, Keys] = {}

    def in_file(self, keys: Sequence[str | int]) -> Keys:
        """Field of ``file`` that a field of the configuration was."""
        for depth in range(len(keys), 0, -1):
            if tuple(keys[:depth]) in self.moved:
                return (*self.moved[tuple(keys[:depth])], *keys[depth:])
        return tuple(keys)

    def find(self, keys: Sequence[str | int]) -> tuple[str, Keys]:
        """``<file>:<line>`` of a field, or of what is closest above it, and the field's keys in that file."""
        source, source_keys = self.file, self.in_file(keys)
        for depth in range(len(source_keys), 0, -1):
            if source_keys[:depth] in self.rig_files:
                source, source_keys = self.rig_files[source_keys[:depth]], source_keys[depth:]
                break
        return f"{source.path}:{source.line_of(source_keys)}", source_keys

    def where(self, keys: Sequence[str | int]) -> str:
        """Words with which a message about a field begins: ``my.yaml:14: agents[1].near``."""
        line, source_keys = self.find(keys)
        return f"{line}: {dotted_path(source_keys)}" if source_keys else line

    def of_scenes_and_agents(self, data: dict[str, Any]) -> dict[Keys, tuple[str, Keys]]:
        """``find`` for all fields of scenes and agents, but not of agents' rigs and labels, by the fields' keys."""
        return {
            keys: self.find(keys)
            for section in ("scenes", "ego", "agents")
            if section in data
            for keys in _iter_keys(data[section], (section,))
        }


def _iter_keys(value: Any, keys: Keys) -> Iterator[Keys]:
    yield keys
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        if key not in ("rig", "frames", "annotation"):
            yield from _iter_keys(item, (*keys, key))
