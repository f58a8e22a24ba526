"""Every module that parses content is listed, with the targets of fuzzing that read through it, or why it has none."""

import ast
from pathlib import Path

import yaml
from targets import TARGETS

ROOT = Path(__file__).parents[2]
LISTED = yaml.safe_load((Path(__file__).parent / "readers.yaml").read_text())
PARSERS = {
    *("loads", "parse_json", "parse_yaml", "load_yaml", "YamlFile", "model_validate_json", "from_json"),
    *("fromstring", "iterparse", "ParserCreate", "FileProcessor", "SimpleCookie", "parse_qs", "read_unpacked"),
    *("unpack", "unpack_from", "iter_unpack", "frombuffer", "read_array", "NpzReader", "ZipFile"),
    *("ParquetFile", "read_table", "deserialize_cdr", "deserialize_message", "decode_jpeg", "InferenceSession"),
    *("np.load", "yaml.load", "ElementTree.parse"),
}
"""Names of functions that parse content; with a dot if only the module's own function does."""
ELSEWHERE = "simbev_ros/foundation/object_store"
"""Answers of stores, which have tests of their own: test_hostile_stores.py, test_object_lock.py."""
NOT_PARSING = {"cache_file", "cache_folder", "lock", "client_requests", "report", "entity_filter"}
"""Targets of content that is compared or passed on instead of parsed."""


def parsing_modules() -> set[str]:
    """Modules of the package that call a parser."""
    files = (path for path in ROOT.glob("simbev_ros/**/*.py") if ELSEWHERE not in path.as_posix())
    return {path.relative_to(ROOT).as_posix() for path in files if is_parsing(ast.parse(path.read_text()))}


def is_parsing(tree: ast.AST) -> bool:
    calls = (node.func for node in ast.walk(tree) if isinstance(node, ast.Call))
    names = (ast.unparse(call) for call in calls)
    return any(name in PARSERS or name.rpartition(".")[2] in PARSERS for name in names)


def test_every_module_that_parses_is_listed() -> None:
    assert parsing_modules() == LISTED.keys()


def test_the_list_names_all_targets_that_parse_and_no_other() -> None:
    assert all(LISTED.values())
    used = {name for targets in LISTED.values() if not isinstance(targets, str) for name in targets}
    assert used == TARGETS.keys() - NOT_PARSING
