"""YAML and JSON from elsewhere: what is valid is parsed as by other parsers, what demands too much is refused."""

from pathlib import Path

import pytest
import yaml

from simbev_ros.foundation.errors import LimitError
from simbev_ros.foundation.files.structured_text import load_yaml, parse_json, parse_yaml

ALIASES = "\n".join(["a0: &a0 [x, x]", *(f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]" for k in range(1, 12))])

MERGES = "a: &a {k: 1}\nb:\n" + "\n".join(f"  - {{<<: [{'*a, ' * 999}]}}" for _ in range(300))
FAULTS = ["&a [*a]", "[1", "!!timestamp x", "!!int x", "!!python/name:os.system", "*a", b"\xff\xfe\xfa"]


def test_values_are_those_of_pyyaml(tmp_path: Path) -> None:
    text = "a: [1, 2.5, x, null, 2024-01-02]\nb: &b {c: 'd', e: |\n  long\n  text\n}\nf: *b\n" + "sha256: " + "1" * 64
    text = text.replace("|\n  long\n  text\n", '"long text"')
    (tmp_path / "a.yaml").write_text(text)
    assert parse_yaml(text) == load_yaml(tmp_path / "a.yaml") == yaml.safe_load(text)
    assert parse_yaml("") is None


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (ALIASES, "it has more than 200,000 values"),
        (
            "a: &a {k: 1}\nb:\n" + "\n".join(f"  - &b{k} {{<<: [{'*a, ' * 999}]}}" for k in range(300)),
            "more than 200,000",
        ),
        ("[" * 3000, "line 1: it is nested more than 64 deep"),
        ("{a: " * 3000, "line 1: it is nested more than 64 deep"),
        ("x: " + "1" + ":1" * 1_000_000, "line 1: a number has 2,000,001 characters"),
        ("# " + "x" * (4 << 20), "longer than 4 MiB"),
    ],
)
def test_texts_that_demand_too_much_are_refused(text: str, problem: str) -> None:
    with pytest.raises(LimitError, match=problem):
        parse_yaml(text)


@pytest.mark.parametrize(
    "text", ["&a [*a]", "[1", "!!timestamp x", "!!int x", "!!python/name:os.system", "*a", b"\xff\xfe\xfa"]
)
def test_all_other_faults_are_value_errors(text: str | bytes) -> None:
    with pytest.raises(ValueError):
        parse_yaml(text)


def test_deep_json_is_refused() -> None:
    assert parse_json('{"a": [1, null]}') == {"a": [1, None]}
    with pytest.raises(LimitError, match="nested too deeply"):
        parse_json("[" * 100_000)
