"""The verbs and options of simbev that pages on its use with other programs, and templates, name exist."""

import re
from pathlib import Path

import pytest
import typer

from simbev_ros.cli.main import VERBS, load_verb

ROOT = Path(__file__).parents[2]
TEXTS = [
    ROOT / "docs/guide/container.md",
    ROOT / "docs/guide/many-machines.md",
    ROOT / "docs/guide/autoware.md",
    ROOT / "docs/guide/nav2.md",
    ROOT / "deploy/kubernetes/rayjob.yaml",
    ROOT / "deploy/slurm/generate.sbatch",
]
CODE = re.compile(r"^```sh\n(.*?)^```$|`([^`\n]+)`", re.DOTALL | re.MULTILINE)
CALL = re.compile(r"""(?:^|[\s`/])simbev"? ([a-z]+)([^\n`#|]*)""")
OF_THE_START_SCRIPT = {"setup"}


def calls() -> set[tuple[str, str]]:
    """Verb and option of each call in the texts; the option is empty for the verb alone."""
    found = set()
    for path in TEXTS:
        text = path.read_text()
        if path.suffix == ".md":
            text = "\n".join(block or inline for block, inline in CODE.findall(text))
        for verb, rest in CALL.findall(text):
            found |= {
                (verb, ""),
                *((verb, option) for option in re.findall(r"--[a-z-]+", rest.partition("--ros-args")[0])),
            }
    return found


NAMED = [
    pytest.param(*call, id=" ".join(call).strip()) for call in sorted(calls()) if call[0] not in OF_THE_START_SCRIPT
]


@pytest.mark.parametrize(("verb", "option"), NAMED)
def test_what_is_named_exists(verb: str, option: str) -> None:
    assert verb in VERBS
    loaded = load_verb(verb)
    if not isinstance(loaded, typer.Typer):
        function, loaded = loaded, typer.Typer()
        loaded.command()(function)
    command = typer.main.get_command(loaded)
    commands = [command, *getattr(command, "commands", {}).values()]
    assert not option or option in {name for each in commands for parameter in each.params for name in parameter.opts}


def test_the_pages_name_the_verbs_that_matter() -> None:
    assert {verb for verb, _ in calls()} >= {"demo", "doctor", "generate", "logs", "run", "setup"}
