"""The Dockerfile keeps the rules that linters of Dockerfiles check, and repeats nothing that the set-up knows."""

import json
import re
from pathlib import Path

import pytest
import yaml
from dockerfile_parse import DockerfileParser

ROOT = Path(__file__).parents[2]
SYSTEM_LIBRARIES = yaml.safe_load((ROOT / "simbev_ros/foundation/installation/system_libraries.yaml").read_text())


@pytest.fixture(scope="module")
def steps() -> list[tuple[str, str]]:
    """Instruction and value of each step."""
    with (ROOT / "Dockerfile").open("rb") as file:
        structure = DockerfileParser(fileobj=file).structure
    return [(step["instruction"], step["value"]) for step in structure if step["instruction"] != "COMMENT"]


def values(steps: list[tuple[str, str]], instruction: str) -> list[str]:
    return [value for name, value in steps if name == instruction]


def test_the_user_is_not_root(steps: list[tuple[str, str]]) -> None:
    assert values(steps, "USER")[-1] not in ("root", "0")


@pytest.mark.parametrize("instruction", ["ENTRYPOINT", "CMD"])
def test_no_shell_stands_between_the_container_and_simbev(steps: list[tuple[str, str]], instruction: str) -> None:
    (value,) = values(steps, instruction)
    assert all(isinstance(word, str) for word in json.loads(value))


def test_what_is_copied_exists(steps: list[tuple[str, str]]) -> None:
    sources = [source for value in values(steps, "COPY") for source in value.split()[:-1]]
    assert [source for source in sources if not (ROOT / source).exists()] == []


def test_the_large_layer_depends_on_nothing_but_what_the_set_up_reads(steps: list[tuple[str, str]]) -> None:
    first_run = next(index for index, (name, _) in enumerate(steps) if name == "RUN")
    copied = {source for name, value in steps[:first_run] if name == "COPY" for source in value.split()[:-1]}
    hashed = re.search(r"cksum ([^)]*)\)", (ROOT / "simbev").read_text())
    assert hashed is not None
    for file in hashed[1].split():
        assert any(file == source or file.startswith(f"{source}/") for source in copied), file
    assert copied.isdisjoint({".", "simbev_ros", "test", "docs"})


def test_layers_with_packages_delete_the_lists_of_packages(steps: list[tuple[str, str]]) -> None:
    installing = [value for value in values(steps, "RUN") if "apt-get install" in value or "simbev setup" in value]
    assert installing
    for value in installing:
        assert value.rstrip().endswith("/var/lib/apt/lists/*")


def test_libraries_of_the_system_are_named_in_their_table_alone(steps: list[tuple[str, str]]) -> None:
    packages = {*SYSTEM_LIBRARIES["linked"].values(), *SYSTEM_LIBRARIES["opened"].values()}
    words = set(re.findall(r"[\w.+-]+", " ".join(values(steps, "RUN"))))
    assert packages & words == set()


def test_gpus_are_given_with_their_graphics(steps: list[tuple[str, str]]) -> None:
    assert re.search(r"NVIDIA_DRIVER_CAPABILITIES=\S*\bgraphics\b", " ".join(values(steps, "ENV")))


def test_hidden_files_do_not_enter_the_image() -> None:
    rules = [rule for rule in (ROOT / ".dockerignore").read_text().splitlines() if not rule.startswith("#")]
    assert rules[0] == ".*"
    assert {"test", "docs", "out", "datasets"} <= set(rules)


def test_a_label_says_where_the_bill_of_materials_is(steps: list[tuple[str, str]]) -> None:
    (place,) = [value.partition("=")[2] for value in values(steps, "ARG") if value.startswith("SBOM=")]
    assert place.endswith(".cdx.json"), "by which scanners find it"
    assert any(value.endswith((f'.sbom="{place}"', '.sbom="${SBOM}"')) for value in values(steps, "LABEL"))
    assert any('./simbev sbom >"${SBOM}"' in value for value in values(steps, "RUN"))
