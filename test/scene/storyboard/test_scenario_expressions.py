"""Expressions of scenarios have the values that Python computes, and nothing else is evaluated."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from simbev_ros.scene.storyboard.expressions import evaluate
from simbev_ros.scene.storyboard.parameters import read_value, substitute, text_of

VALUES = {"a": 7, "b": -2.5, "yes": True, "name": "ego"}


def value_of(text: str) -> Any:
    return evaluate(text, VALUES.__getitem__)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("4+6*5", 34),
        ("-15 + 3.14 + 23 + 2.1E-7 + sqrt(9) + pow(3.2,3)", -15 + 3.14 + 23 + 2.1e-7 + 3 + 3.2**3),
        ("($a + 3)/4", 2.5),
        ("$a % 4", 3),
        ("-7 % 4", -3),
        ("-$a", -7),
        ("round(2.5) + round(-2.5) * 10", 3 - 30),
        ("floor($b) * 100 + ceil($b)", -302),
        ("sign($b) + abs($b)", 1.5),
        ("max($a, 9) - min($a, 9)", 2),
        ("sin(1) + cos(1) + tan(1)", math.sin(1) + math.cos(1) + math.tan(1)),
        ("asin(0.5) + acos(0.5) + atan(2)", math.pi / 2 + math.atan(2)),
        ("not $yes or true and not false", True),
    ],
)
def test_an_expression_has_its_value(text: str, expected: Any) -> None:
    assert value_of(text) == pytest.approx(expected)
    assert type(value_of(text)) is type(expected)


NUMBERS = st.one_of(st.integers(-99, 99), st.floats(-99, 99).map(lambda value: round(value, 3)))
SUMS = st.recursive(
    NUMBERS.map(lambda value: f"({value})"),
    lambda inner: st.tuples(inner, st.sampled_from("+-*"), inner).map(lambda parts: f"({' '.join(parts)})"),
    max_leaves=8,
)


@given(SUMS)
def test_sums_and_products_are_those_of_python(text: str) -> None:
    assert value_of(text) == eval(text)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "not an expression"),
        ("1 +", "not an expression"),
        ("1/0", "has no value"),
        ("sqrt(-1)", "has no value"),
        ("pow(10, 400)", "has no value"),
        ("1e308 * 10", "exceeds the range of numbers"),
        ("9223372036854775807 + 1", "exceeds the range of numbers"),
        ("2 ** 3", "has something that expressions do not have"),
        ("7 // 2", "has something that expressions do not have"),
        ("1 < 2", "neither a number nor a parameter"),
        ("1j * 2", "neither a number nor a parameter"),
        ("'x' * 9", "neither a number nor a parameter"),
        ("[1][0]", "neither a number nor a parameter"),
        ("__import__(1)", "has something that expressions do not have"),
        ("(1).real", "neither a number nor a parameter"),
        ("round(1, 2)", "has no value"),
        ("a + 1", "neither a number nor a parameter"),
        ("$name + 1", "has the operand 'ego', which is not a number"),
        ("$yes + 1", "has the operand True, which is not a number"),
        ("not 1", "has the operand 1, which is not a boolean"),
        ("(" * 199 + "1" + ")" * 199 + "+" * 200, "not an expression"),
        ("-" * 150 + "1", "is nested more than 100 deep"),
        ("1 + " * 300 + "1", "has 1,201 characters; allowed are 1,000"),
    ],
)
def test_anything_else_is_refused(text: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        value_of(text)


@pytest.mark.parametrize(
    ("value", "text"), [(True, "true"), (3, "3"), (3.0, "3"), (0.1, "0.1"), (1e300, "1e+300"), ("x", "x")]
)
def test_values_are_written_as_files_have_them(value: Any, text: str) -> None:
    assert text_of(value) == text


def test_a_dollar_after_a_backslash_is_a_dollar() -> None:
    assert substitute("\\$a", {}) == "$a"


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        ("int", "2147483648"),
        ("unsignedInt", "-1"),
        ("unsignedShort", "65536"),
        ("double", "1_0"),
        ("double", "inf"),
        ("boolean", "True"),
        ("dateTime", "noon"),
        ("integer", "1" * 5000),
    ],
)
def test_a_text_that_is_not_of_its_type_is_refused(kind: str, text: str) -> None:
    with pytest.raises(ValueError, match="must be"):
        read_value(kind, text)
