"""Reader of YAML files written by users: safe, strict about repeated keys, and aware of the line of every value."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from simbev_ros.errors import InputError

_MAX_BYTES = 4 << 20
_MAX_NODES = 200_000


class YamlFile:
    """A parsed YAML file.

    Attributes:
        path: The file.
        data: Its contents as mappings, lists and scalars.

    Raises:
        InputError: The file cannot be read, is not YAML, repeats a key, or its aliases expand to too many values.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            if path.stat().st_size > _MAX_BYTES:
                raise InputError(f"{path}: larger than {_MAX_BYTES >> 20} MiB; this is no configuration file")
            text = path.read_text(encoding="utf-8")
            self._root = yaml.compose(text, Loader=yaml.SafeLoader)
            if self._root is not None:
                _check(self._root, path)
            self.data: Any = yaml.safe_load(text)
        except (OSError, UnicodeDecodeError) as error:
            raise InputError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
        except yaml.YAMLError as error:
            raise InputError(f"{path}: not valid YAML: {' '.join(str(error).split())}") from None
        except (ValueError, RecursionError) as error:
            raise InputError(f"{path}: not valid YAML: {error}") from None

    def line_of(self, keys: Sequence[str | int]) -> int | None:
        """Line, counted from 1, of the value at a path of keys and indices, or of the deepest existing part of it."""
        node = self._root
        for key in keys:
            child = _child(node, key)
            if child is None:
                break
            node = child
        return node.start_mark.line + 1 if node is not None else None


def _child(node: Any, key: str | int) -> Any:
    if isinstance(node, yaml.MappingNode):
        return next((value for name, value in node.value if name.value == str(key)), None)
    if isinstance(node, yaml.SequenceNode) and isinstance(key, int) and key < len(node.value):
        return node.value[key]
    return None


def _check(root: yaml.Node, path: Path) -> None:
    """Refuse repeated keys, cycles, and aliases that expand to more than ``_MAX_NODES`` values ("YAML bombs")."""
    sizes: dict[int, int] = {}
    open_nodes: set[int] = set()

    def size(node: yaml.Node) -> int:
        if id(node) in sizes:
            return sizes[id(node)]
        where = f"{path}:{node.start_mark.line + 1}"
        if id(node) in open_nodes:
            raise InputError(f"{where}: an alias refers to what it is part of")
        open_nodes.add(id(node))
        total = 1
        if isinstance(node, yaml.MappingNode):
            names = [name.value for name, _ in node.value if isinstance(name, yaml.ScalarNode)]
            twice = sorted({name for name in names if names.count(name) > 1})
            if twice:
                raise InputError(f"{where}: key {twice[0]} appears twice")
            total += sum(size(name) + size(value) for name, value in node.value)
        elif isinstance(node, yaml.SequenceNode):
            total += sum(size(item) for item in node.value)
        if total > _MAX_NODES:
            raise InputError(f"{where}: expands to more than {_MAX_NODES} values through its aliases")
        open_nodes.discard(id(node))
        sizes[id(node)] = total
        return total

    size(root)
