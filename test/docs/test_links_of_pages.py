"""Links, anchors and named paths of all Markdown pages lead somewhere."""

import re
from collections import Counter
from pathlib import Path

import pytest
import yaml

from tools.docs.links import anchors, broken_links, headings, missing_paths
from tools.docs.markdown import GENERATED, slug

ROOT = Path(__file__).parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
IDS = [str(page.relative_to(ROOT)) for page in PAGES]


@pytest.mark.parametrize("page", PAGES, ids=IDS)
def test_links_lead_to_files_and_headings(page: Path) -> None:
    assert broken_links(page, ROOT) == []


@pytest.mark.parametrize("page", PAGES, ids=IDS)
def test_named_paths_exist(page: Path) -> None:
    assert missing_paths(page, ROOT) == []


@pytest.mark.parametrize("page", PAGES, ids=IDS)
def test_named_tests_exist(page: Path) -> None:
    modules = sorted((ROOT / "test").rglob("test_*.py"))
    known = {name for module in modules for name in re.findall(r"def (test_\w+)", module.read_text())}
    text = page.read_text()
    new = set(re.findall(r"(?:def |\w/)(test_\w+)", text))  # that readers of the page write
    assert set(re.findall(r"\btest_\w+", text)) <= known | new | {module.stem for module in modules}


@pytest.mark.parametrize("page", PAGES, ids=IDS)
def test_headings_have_the_same_anchor_on_forges_and_on_the_site(page: Path) -> None:
    for heading in headings(page.read_text()):
        on_site = re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", heading.replace("`", "")).strip().lower())
        assert slug(heading) == on_site


def test_every_page_is_in_the_navigation() -> None:
    text = re.sub(r"!!python/name:\S+", "null", (ROOT / "mkdocs.yml").read_text())
    listed = set(re.findall(r"[\w/-]+\.md", str(yaml.safe_load(text)["nav"])))
    assert listed == {str(page.relative_to(ROOT / "docs")) for page in PAGES if page.is_relative_to(ROOT / "docs")}


def test_pages_of_docs_that_are_written_by_hand_have_at_most_30_000_words() -> None:
    texts = {str(page.relative_to(ROOT)): page.read_text() for page in PAGES if page.is_relative_to(ROOT / "docs")}
    words = Counter({name: len(text.split()) for name, text in texts.items() if GENERATED not in text})
    longest = ", ".join(f"{name} {count}" for name, count in words.most_common(5))
    assert words.total() <= 30_000, (
        f"docs/ has {words.total()} words, counted as `wc -w` does, with code blocks. Shorten as much as was added: "
        f"what a reader can skip, and what two pages say. The longest pages: {longest}"
    )


def test_broken_links_are_found(tmp_path: Path) -> None:
    (tmp_path / "other.md").write_text("# A heading: with `code`\n\n```\n# no heading\n```\n")
    page = tmp_path / "page.md"
    page.write_text(
        "[a](other.md) [b](other.md#a-heading-with-code) [c](https://example.org) `[d](none.md)`\n"
        "[e](none.md) [f](other.md#no-heading) [g](../../none.md)\n"
    )
    assert broken_links(page, tmp_path) == [
        "none.md: no such file",
        "other.md#no-heading: no such heading",
        "../../none.md: outside of the repository",
    ]
    assert anchors(tmp_path / "other.md") == ("a-heading-with-code",)


def test_missing_paths_are_found(tmp_path: Path) -> None:
    (tmp_path / "simbev_ros").mkdir()
    (tmp_path / "simbev_ros" / "there.py").touch()
    page = tmp_path / "page.md"
    page.write_text("`simbev_ros/there.py` and `simbev_ros/none.py`; simbev_ros/prose.py is no code\n")
    assert missing_paths(page, tmp_path) == ["simbev_ros/none.py"]
