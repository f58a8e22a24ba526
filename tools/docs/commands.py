"""docs/reference/commands.md: every verb with arguments, options, defaults and examples, from typer."""

import inspect
import re
import sys
import tomllib
import types
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import typer
from typer.models import ArgumentInfo, OptionInfo

from simbev_ros.cli.main import VERBS, load_verb
from tools.docs.markdown import GENERATED, code, sentence, table

_INTRODUCTION = """# Commands

`./simbev` at the top of the repository is a start script. It sets the machine up once and then runs the command below.
Inside an activated environment the same command is called `simbev`.

`simbev train` and `simbev predict` come with a distribution of their own: `.venv/bin/pip install ./training`.

The start script adds four verbs of its own, the last three for developers:

| verb | what it does |
|---|---|
| `./simbev setup [EXTRA,…]` | Sets the machine up, with these extras, and ends, as for a container image. |
| `./simbev test [--all] [pytest options]` | Runs lint, type checks and tests; `--all` includes the slow tests. |
| `./simbev fuzz [TARGET …] [OPTION …]` | Feeds damaged files and messages to their readers, guided by coverage. |
| `./simbev docs` | Regenerates the reference pages and builds this documentation as a site. |

Exit codes: 0 done, 1 failed, 2 bad input (the message names file, field and value), 130 interrupted. With the
environment variable `SIMBEV_TRACEBACK=1`, unexpected errors show their traceback.
"""
_SATELLITES = [Path(__file__).parents[2] / name for name in ("exporters", "training")]
_EXAMPLES = re.compile(r"\[bold\]Examples?\[/\]")
_MARKUP = re.compile(r"\[/?(?:bold|dim|italic|/)?\]")


@dataclass(frozen=True, slots=True)
class Parameter:
    """An argument or an option of a command, as its function declares it.

    Attributes:
        name: Of the function's parameter.
        annotation: Its type, without what typer attaches to it.
        info: What typer attaches to it.
        names: Of an option, as it is typed; empty: they follow from ``name``.
        default: Its default; ``inspect.Parameter.empty`` or ``...``: it is required.
    """

    name: str
    annotation: Any
    info: ArgumentInfo | OptionInfo
    names: tuple[str, ...]
    default: Any

    @property
    def is_required(self) -> bool:
        """Whether a value must be given."""
        return self.default in (inspect.Parameter.empty, ...)

    @property
    def help(self) -> str:
        """Its description."""
        return sentence(_MARKUP.sub("", self.info.help or ""))

    @property
    def argument_word(self) -> str:
        """The name of an argument in the line of usage."""
        word = str(self.info.metavar or self.name).upper().strip("[]")
        word += "..." if get_origin(_without_none(self.annotation)) is list else ""
        return word if self.is_required else f"[{word}]"

    @property
    def option_words(self) -> str:
        """How an option is written, with the form of its value."""
        kind = _without_none(self.annotation)
        if kind is bool:
            dashed = self.name.replace("_", "-")
            return ", ".join(self.names) or f"--{dashed} / --no-{dashed}"
        value = self.info.metavar or _value_word(kind)
        return f"{', '.join(self.names) or '--' + self.name.replace('_', '-')} {value}"

    @property
    def default_text(self) -> str:
        """Default of an option; empty where it says nothing."""
        if self.is_required:
            return "required"
        if self.default is None or self.default in ((), [], "") or _without_none(self.annotation) is bool:
            return ""
        return code(str(self.default))


def render_commands() -> str:
    """The whole page."""
    parts = [GENERATED, _INTRODUCTION, *(_section(words, call) for words, call in commands())]
    return "\n".join(part.rstrip("\n") + "\n" for part in parts)


def commands() -> Iterator[tuple[tuple[str, ...], Callable[..., Any]]]:
    """All commands, at the end those of our other distributions: the words that call them, and their functions."""
    for name in VERBS:
        verb = load_verb(name)
        words = ("simbev", name)
        yield from _commands_of(verb, words) if isinstance(verb, typer.Typer) else [(words, verb)]
    for folder in _SATELLITES:
        sys.path.insert(0, str(folder))  # before an installed copy, which may be older
        project = tomllib.loads((folder / "pyproject.toml").read_text(encoding="utf-8"))["project"]
        for group, parent in (("simbev.exporters", "simbev export"), ("simbev.verbs", "simbev")):
            for name, at in project["entry-points"].get(group, {}).items():
                module, _, attribute = at.partition(":")
                yield (*parent.split(), name), getattr(import_module(module), attribute)


def _commands_of(group: typer.Typer, words: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Callable[..., Any]]]:
    for each in group.registered_commands:
        assert each.callback is not None
        yield (*words, each.name or each.callback.__name__.replace("_", "-").strip("-")), each.callback


def parameters(call: Callable[..., Any]) -> list[Parameter]:
    """Arguments and options of a command, in order."""
    found = []
    for name, each in inspect.signature(call, eval_str=True).parameters.items():
        annotation, default = each.annotation, each.default
        attached = get_args(annotation)[1:] if get_origin(annotation) is Annotated else (default,)
        info = next((item for item in attached if isinstance(item, (ArgumentInfo, OptionInfo))), None)
        if info is None:
            continue
        if get_origin(annotation) is Annotated:  # there, typer takes the first name for a default
            first = (info.default,) if isinstance(info.default, str) else ()
            found.append(Parameter(name, get_args(annotation)[0], info, (*first, *(info.param_decls or ())), default))
        else:
            found.append(Parameter(name, annotation, info, tuple(info.param_decls or ()), info.default))
    return found


def _section(words: tuple[str, ...], call: Callable[..., Any]) -> str:
    text, examples = _split(inspect.getdoc(call) or "")
    known = parameters(call)
    arguments = [each for each in known if isinstance(each.info, ArgumentInfo)]
    options = [each for each in known if isinstance(each.info, OptionInfo)]
    usage = " ".join([*words, *(each.argument_word for each in arguments), *(["[OPTIONS]"] if options else [])])
    parts = [f"## {' '.join(words)}", _paragraphs(text), f"```sh\n{usage}\n```"]
    if arguments:
        parts.append(table(("argument", "meaning"), [(code(each.argument_word), each.help) for each in arguments]))
    if options:
        rows = [(code(each.option_words), each.default_text, each.help) for each in options]
        parts.append(table(("option", "default", "meaning"), rows))
    if lines := [line.strip() for line in examples.splitlines() if line.strip()]:
        parts.append("Examples:\n\n```sh\n" + "\n".join(lines) + "\n```")
    return "\n\n".join(part.strip("\n") for part in parts if part)


def _split(help_text: str) -> tuple[str, str]:
    """Help before and after the heading of the examples."""
    match = _EXAMPLES.search(help_text)
    return (help_text, "") if match is None else (help_text[: match.start()], help_text[match.end() :])


def _paragraphs(text: str) -> str:
    plain = _MARKUP.sub("", text)
    return "\n\n".join(sentence(each) for each in re.split(r"\n\s*\n", plain) if each.strip())


def _without_none(annotation: Any) -> Any:
    """The type of a value that may be left out."""
    if get_origin(annotation) in (Union, types.UnionType):
        return next(each for each in get_args(annotation) if each is not type(None))
    return annotation


def _value_word(kind: Any) -> str:
    """How a value of a type is written."""
    if get_origin(kind) is Literal:
        return "|".join(map(str, get_args(kind)))
    if get_origin(kind) is list:
        return _value_word(get_args(kind)[0])
    return {int: "INTEGER", float: "NUMBER", Path: "PATH"}.get(kind, "TEXT")
