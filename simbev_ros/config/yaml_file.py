"""Reader of YAML files written by users: safe, strict about repeated keys, and aware of the line of every value."""

import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml
from yaml.composer import ComposerError
from yaml.constructor import ConstructorError

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.input_file import read_small_file
from simbev_ros.foundation.files.limits import MAX_YAML_BYTES, MAX_YAML_DEPTH, MAX_YAML_NUMBER_CHARS, MAX_YAML_VALUES

_UNUSABLE = re.compile("[\0\ud800-\udfff]")
"""Characters that escape sequences can produce, but that are in no name of a file and in no text."""


class YamlFile:
    """A parsed YAML file.

    Args:
        path: The file.
        text: Its contents, of which ``path`` is only the name in messages; None: they are read from the file.

    Attributes:
        path: The file.
        data: Its contents as mappings, lists and scalars.

    Raises:
        InputError: The file cannot be read, is not YAML, repeats a key, is nested too deeply, or has too many values,
            also by its aliases.
    """

    def __init__(self, path: Path, text: str | None = None) -> None:
        self.path = path
        try:
            loader = _Loader(read_small_file(path, MAX_YAML_BYTES).decode() if text is None else text)
            loader.name = path.name
            self._root = loader.get_single_node()
            self.data: Any = None
            if self._root is not None:
                _check(self._root, path)
                self.data = loader.construct_document(self._root)
        except UnicodeDecodeError as error:
            raise InputError(f"{path}: cannot be read: {error}") from None
        except yaml.YAMLError as error:
            raise InputError(f"{path}: not valid YAML: {' '.join(str(error).split())}") from None

    def line_of(self, keys: Sequence[str | int]) -> int | None:
        """Line, counted from 1, of the value at a path of keys and indices, or of the deepest existing part of it."""
        node = self._root
        for key in keys:
            child = _child(node, key)
            if child is None:
                break
            node = child
        return node.start_mark.line + 1 if node is not None else None


_NUMBERS = ("tag:yaml.org,2002:int", "tag:yaml.org,2002:float", "tag:yaml.org,2002:timestamp")


class _Loader(yaml.SafeLoader):
    """A safe loader with limits; all of its errors are ``yaml.YAMLError`` and name a line."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._depth = self._nodes = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """Compose a node with all that is in it; called by the base class."""
        self._nodes += 1
        where = None if parent is None else parent.start_mark
        if self._nodes > MAX_YAML_VALUES:
            raise ComposerError(None, None, f"more than {MAX_YAML_VALUES} values", where)
        if self._depth == MAX_YAML_DEPTH:
            raise ComposerError(None, None, f"nested deeper than {MAX_YAML_DEPTH} levels", where)
        self._depth += 1
        node: yaml.Node | None = super().compose_node(parent, index)
        self._depth -= 1
        return node

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        """Construct the value of a node; called by the base class, which raises what Python's conversions raise."""
        is_number = node.tag in _NUMBERS
        if is_number and len(node.value) > MAX_YAML_NUMBER_CHARS:  # those to the base 60 take quadratic time
            problem = f"a number has {len(node.value):,} characters; allowed are {MAX_YAML_NUMBER_CHARS}"
            raise ConstructorError(None, None, problem, node.start_mark)
        try:
            return super().construct_object(node, deep)
        except (ArithmeticError, AttributeError, LookupError, ValueError):
            kind, text = node.tag.rpartition(":")[2], f"{node.value!r:.80}"
            raise ConstructorError(None, None, f"{text} is not a valid {kind}", node.start_mark) from None


def _child(node: Any, key: str | int) -> Any:
    if isinstance(node, yaml.MappingNode):
        return next((value for name, value in node.value if name.value == str(key)), None)
    if isinstance(node, yaml.SequenceNode) and isinstance(key, int) and key < len(node.value):
        return node.value[key]
    return None


def _check(root: yaml.Node, path: Path) -> None:
    """Refuse repeated keys, unusable characters, cycles, and aliases that expand to too many values ("YAML bombs")."""
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
            names = Counter(name.value for name, _ in node.value if isinstance(name, yaml.ScalarNode))
            twice = sorted(name for name, count in names.items() if count > 1)
            if twice:
                raise InputError(f"{where}: key {twice[0]} appears twice")
            total += sum(size(name) + size(value) for name, value in node.value)
        elif isinstance(node, yaml.SequenceNode):
            total += sum(size(item) for item in node.value)
        elif _UNUSABLE.search(node.value):
            raise InputError(f"{where}: a text contains a character that no text may contain")
        if total > MAX_YAML_VALUES:
            raise InputError(f"{where}: expands to more than {MAX_YAML_VALUES} values through its aliases")
        open_nodes.discard(id(node))
        sizes[id(node)] = total
        return total

    size(root)
