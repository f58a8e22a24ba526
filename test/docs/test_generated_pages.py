"""The reference pages say what the code says, completely."""

import re

import pytest

from simbev_ros.foundation.installation.interface_files import OWN_PACKAGE, interface_files
from simbev_ros.ros.msgs import topics
from tools.docs.commands import commands
from tools.docs.configuration import documented_models, models_in
from tools.docs.interfaces import render_interfaces
from tools.docs.pages import PAGES, REFERENCE
from tools.docs.topics import descriptions, matching, paper_topics


@pytest.mark.parametrize("name", PAGES)
def test_page_is_what_the_code_gives(name: str) -> None:
    written = (REFERENCE / name).read_text(encoding="utf-8")
    assert written == PAGES[name](), f"{name} is out of date: run python -m tools.docs"


def test_every_field_of_the_configuration_has_a_description() -> None:
    for model in documented_models():
        for name, field in model.model_fields.items():
            is_section = "type" in model.model_fields and name == "type"
            described = field.description or is_section or _is_described_by_its_model(field.annotation)
            assert described, f"{model.__name__}.{name} has no description"


def _is_described_by_its_model(annotation: object) -> bool:
    return len(models_in(annotation)) == 1


def test_every_topic_has_one_row() -> None:
    names = list(paper_topics())
    shown = [(each.show, matching(each, names)) for each in descriptions()]
    rows = {name: [show for show, matched in shown if name in matched] for name in names}
    assert all(len(shown) == 1 for shown in rows.values()), {k: v for k, v in rows.items() if len(v) != 1}


def test_every_row_stands_for_a_topic() -> None:
    names = list(paper_topics())
    assert all(each.given or matching(each, names) for each in descriptions())


def test_every_fixed_topic_of_the_code_is_on_the_page() -> None:
    fixed = {value for name, value in vars(topics).items() if name.isupper() and str(value).startswith("/")}
    assert fixed <= {each.show for each in descriptions()}


def test_every_field_of_the_interfaces_has_a_row_with_its_comment() -> None:
    page = render_interfaces()
    for path in interface_files(OWN_PACKAGE).values():
        (section,) = re.findall(rf"^## {path.stem}\n(.*?)(?=^## |\Z)", page, re.MULTILINE | re.DOTALL)
        for line in path.read_text(encoding="utf-8").splitlines():
            if match := re.fullmatch(r"(\S+) (\w+)(?: (\S+))? +# (.*)", line):
                comment = re.escape(match[4].replace("<", "&lt;"))
                assert re.search(
                    rf"^\| .*`{match[2]}`.* \| `{re.escape(match[1])}.*` \| {comment}.*\|$", section, re.M
                ), line


def test_verbs_and_commands_of_groups_are_documented() -> None:
    found = {" ".join(words) for words, _ in commands()}
    assert {"simbev demo", "simbev generate", "simbev export nuscenes", "simbev bench"} <= found
