"""The model of a resolved scenario: a frozen dataclass for each element of OpenSCENARIO XML, made from elements.yaml.

``Scenario`` is the root. A field's name ends in its unit; angles are counter-clockwise. Nothing is converted to a map's
frame or lanes here. Classes are attributes of this module, such as ``model.SpeedAction``; all arguments have keywords.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, dataclass, field, fields, make_dataclass
from typing import TYPE_CHECKING, Any

from simbev_ros.foundation.tables import load_table
from simbev_ros.scene.storyboard.parameters import read_value

TABLE = load_table(__package__, "elements.yaml")
TABLE["elements"] = {kind: row for kinds, row in TABLE["elements"].items() for kind in kinds.split(", ")}
ROOT = "OpenSCENARIO"
"""Tag of the root element of every file of the standard."""

_UNITS = re.compile("_(m|s|kg|lx|cd|pa|k|rad|deg|mps|mps2|mps3|mmph|per_m|per_m2)$")
_FIELD = re.compile(r"([\w |]+?) ?([?*+]|2\+|=\S+)?(?: (as|in|@) ?(\w+))?")


class Element:
    """Base of all elements of a scenario.

    Attributes:
        origin: ``file:line`` of the element, for messages; it does not count in comparisons.
    """

    __slots__ = ()

    if TYPE_CHECKING:
        origin: str

        def __init__(self, **values: Any) -> None: ...

        def __getattr__(self, name: str) -> Any: ...

    @property
    def kind(self) -> str:
        """Name of the element."""
        return type(self).__name__


@dataclass(frozen=True, slots=True)
class FieldSpec:
    """How a file holds a field.

    Attributes:
        name: Name of the field.
        default: Value where nothing is given; ``MISSING`` if something must be.
        attribute: Name of the attribute; empty if the field holds elements.
        type: Type of the attribute, as the table calls it, or the values of an enumeration.
        kinds: Names of the classes of the elements, by their tags.
        wrapper: Tag of an element around them; empty if there is none.
        minimum: Minimum number of elements.
        is_tuple: Whether any number of elements is possible.
    """

    name: str
    default: Any
    attribute: str = ""
    type: Any = None
    kinds: Mapping[str, str] = field(default_factory=dict)
    wrapper: str = ""
    minimum: int = 0
    is_tuple: bool = False


def _spec(name: str, text: str) -> FieldSpec:
    """The meaning of an entry of the table."""
    found = _FIELD.fullmatch(text)
    assert found is not None, (name, text)
    kind, quantity, relation, tag = (part or "" for part in found.groups())
    default: Any = {"?": None, "*": ()}.get(quantity, MISSING)
    if kind not in TABLE["elements"] and kind not in TABLE["unions"] and "|" not in kind:
        choices, literal = TABLE["enumerations"].get(kind), quantity.removeprefix("=")
        if literal != quantity:
            default = literal if choices else read_value(kind, literal)
        head, *rest = _UNITS.sub("", name).split("_")
        attribute = tag or head + "".join(word.capitalize() for word in rest)
        return FieldSpec(name, default, attribute, choices or kind)
    kinds = {item: item for part in kind.split("|") for item in _tags(part.strip())}
    if relation == "as":
        kinds, tag = {tag: kind}, ""
    minimum = {"?": 0, "*": 0, "2+": 2}.get(quantity, 1)
    return FieldSpec(name, default, "", None, kinds, tag, minimum, quantity in ("*", "+", "2+"))


def _tags(name: str) -> Iterator[str]:
    """Names of the elements of a union, or of the one element."""
    if name in TABLE["elements"]:
        yield name
    else:
        for part in TABLE["unions"][name]:
            yield from _tags(part)


SPECS: Mapping[str, tuple[FieldSpec, ...]] = {
    kind: tuple(_spec(name, text) for name, text in row.items()) for kind, row in TABLE["elements"].items()
}
"""The fields of each element."""


def _class_of(kind: str) -> type[Element]:
    columns = [(spec.name, Any, field(default=spec.default)) for spec in SPECS[kind]]
    origin = ("origin", str, field(default="", compare=False, repr=False))
    namespace = {"__module__": __name__}
    return make_dataclass(
        kind, [*columns, origin], bases=(Element,), namespace=namespace, frozen=True, slots=True, kw_only=True
    )


ELEMENTS: Mapping[str, type[Element]] = {kind: _class_of(kind) for kind in SPECS}
"""The class of each element by its name."""


def elements_in(element: Element) -> Iterator[Element]:
    """An element and all elements in it, in the order of the model's fields."""
    yield element
    for column in fields(element):  # type: ignore[arg-type]
        value = getattr(element, column.name)
        for part in value if isinstance(value, tuple) else (value,):
            if isinstance(part, Element):
                yield from elements_in(part)


def __getattr__(name: str) -> Any:
    """The class of an element."""
    try:
        return ELEMENTS[name]
    except KeyError:
        raise AttributeError(name) from None
