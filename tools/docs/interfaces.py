"""docs/reference/interfaces.md: messages, service and action of simbev_interfaces, from the comments in their files."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from simbev_ros.foundation.installation.interface_files import OWN_PACKAGE, interface_files
from tools.docs.markdown import GENERATED, code, table

_INTRODUCTION = """# Messages, service and action

The ROS package `simbev_interfaces` has the world, its labels and its scenes as typed fields. Its files are in
[`interfaces/`](../../interfaces/package.xml). With ROS, build it with `simbev_ros`. As colcon does not look for
packages in packages, name both folders:

```sh
colcon build --base-paths src/simbev_ros src/simbev_ros/interfaces
```

Without an installed ROS, [`simbev doctor --fix`](../guide/ros.md#messages-that-ross-wheels-lack) makes the package.

The messages are on [topics that end in `/typed`](topics.md#typed-messages): live while subscribed, and in bags with
[`recording: {forms: [tables, messages]}`](../guide/datasets.md#tables-and-messages), with their definitions and these
comments. The tables are the fast form: a message of 300 actors has the same bytes as their table, but a reader makes
300 objects of it.

Units are SI units and angles are in radians, as in REP-103. Names of fields are those of the
[columns](box-columns.md), except that `class_id` is the column `class`.
"""
_PARTS = {"msg": ("",), "srv": ("Request", "Response"), "action": ("Goal", "Result", "Feedback")}
_KINDS = {"msg": "Message", "srv": "Service", "action": "Action"}


@dataclass
class Part:
    """A message, or one of the messages of a service or an action.

    Attributes:
        text: What the comment at its beginning says.
        constants: Names with values of the constants below a comment, by this comment.
        fields: Names of consecutive fields with the same type, default value and comment; and these.
    """

    text: str = ""
    constants: dict[str, list[str]] = field(default_factory=dict)
    fields: list[tuple[list[str], str, str]] = field(default_factory=list)


def render_interfaces() -> str:
    """The whole page."""
    parts = [GENERATED, _INTRODUCTION]
    for name, path in sorted(interface_files(OWN_PACKAGE).items(), key=lambda each: _order(each[0])):
        parts.append("\n\n".join(_section(name, path)))
    return "\n".join(part.rstrip("\n") + "\n" for part in parts)


def message_fields_of(message: str) -> list[tuple[list[str], str, str]]:
    """Names of consecutive fields of a message of ours with the same type and comment; and these."""
    path = interface_files(OWN_PACKAGE)[f"{OWN_PACKAGE}/msg/{message}"]
    return _part(path.read_text(encoding="utf-8").splitlines()).fields


def _order(name: str) -> tuple[int, str]:
    return list(_KINDS).index(name.split("/")[1]), name


def _section(name: str, path: Path) -> Iterator[str]:
    package, kind, title = name.split("/")
    source = path.read_text(encoding="utf-8").replace("<", "&lt;")
    parts = [_part(text.splitlines()) for text in source.split("\n---\n")]
    yield f"## {title}"
    yield f"{_KINDS[kind]} `{package}/{kind}/{title}`. {parts[0].text}".rstrip()
    for heading, part in zip(_PARTS[kind], parts, strict=True):
        if heading:
            yield f"**{heading}**"
        yield table(("field", "type", "meaning"), _field_rows(part)).rstrip()
        if part.constants:
            rows = [(text, " ".join(map(code, names))) for text, names in part.constants.items()]
            yield table(("constants", "names and values"), rows).rstrip()


def _field_rows(part: Part) -> Iterator[tuple[str, str, str]]:
    for names, kind, text in part.fields:
        yield " ".join(map(code, names)), code(kind), text


def _part(lines: Sequence[str]) -> Part:
    """Parse a message: comments at its beginning, above constants, and behind fields, continued on indented lines."""
    part, comments = Part(), list[str]()
    for line in lines:
        definition, _, comment = line.partition("#")
        if not definition.strip():
            if comment and definition and part.fields:
                names, kind, text = part.fields[-1]
                part.fields[-1] = (names, kind, f"{text} {comment.strip()}")
            elif comment:
                comments.append(comment.strip())
            elif not (part.text or part.constants or part.fields):
                part.text, comments = " ".join(comments), []
            else:
                comments = []
        elif "=" in definition:
            _, _, constant = definition.strip().partition(" ")
            part.constants.setdefault(" ".join(comments), []).append(constant)
        else:
            kind, name, *default = definition.split()
            _add_field(part, name, " = ".join([kind, *default]), comment.strip())
    return part


def _add_field(part: Part, name: str, kind: str, text: str) -> None:
    if part.fields and part.fields[-1][1:] == (kind, text):
        part.fields[-1][0].append(name)
    else:
        part.fields.append(([name], kind, text))
