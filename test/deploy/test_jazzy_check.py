"""The check on an installed ROS 2 Jazzy, which needs Docker, is in step with what it calls."""

import os
import re
import subprocess
from pathlib import Path

import pytest
import yaml
from dockerfile_parse import DockerfileParser

from simbev_ros.cli.main import VERBS

ROOT = Path(__file__).parents[2]
SCRIPT = (ROOT / ".ci/jazzy").read_text()
OF_THE_START_SCRIPT = {"setup", "test"}


def steps(name: str) -> list[tuple[str, str]]:
    """Instruction and value of each step of a Dockerfile."""
    with (ROOT / name).open("rb") as file:
        structure = DockerfileParser(fileobj=file).structure
    return [(step["instruction"], step["value"]) for step in structure if step["instruction"] != "COMMENT"]


STEPS = steps(".ci/jazzy.Dockerfile")


def copies(of: list[tuple[str, str]]) -> list[str]:
    """What a Dockerfile copies before it first installs Python packages, that is, calls the set-up."""
    end = next(index for index, (name, value) in enumerate(of) if name == "RUN" and "simbev setup" in value)
    return [value for name, value in of[:end] if name == "COPY"]


def test_the_set_up_gets_the_files_that_it_gets_in_the_image_for_users() -> None:
    assert copies(STEPS) == copies(steps("Dockerfile"))


def test_the_command_is_the_script_of_the_mounted_checkout() -> None:
    assert STEPS[-1] == ("CMD", '["/source/.ci/jazzy", "inside"]')
    assert "inside) check" in SCRIPT and '--volume "$checkout:/source:ro"' in SCRIPT
    assert os.access(ROOT / ".ci/jazzy", os.X_OK)


def test_the_package_lies_where_the_image_has_set_it_up() -> None:
    (folder,) = re.findall(r"^package=(\S+)$", SCRIPT, re.MULTILINE)
    assert ("WORKDIR", folder) in STEPS


@pytest.mark.parametrize("verb", sorted(set(re.findall(r'(?:ros simbev|/simbev") ([a-z]+)', SCRIPT))))
def test_verbs_exist(verb: str) -> None:
    assert verb in {*VERBS, *OF_THE_START_SCRIPT}


def launches() -> list[tuple[str, str]]:
    """Launch file and name of each argument that the script gives it."""
    calls = re.findall(r"ros2 launch simbev_ros (\S+)(.*)", SCRIPT)
    return [(file, name) for file, arguments in calls for name in re.findall(r"(\w+):=", arguments)]


@pytest.mark.parametrize(("file", "argument"), launches())
def test_launch_files_take_these_arguments(file: str, argument: str) -> None:
    assert re.search(rf'DeclareLaunchArgument\(\s*"{argument}"', (ROOT / "launch" / file).read_text())


@pytest.mark.parametrize("path", sorted(set(re.findall(r"(?:simbev_ros\)|\$package)/(\w[\w./-]*)", SCRIPT))))
def test_named_files_of_the_package_exist(path: str) -> None:
    assert (ROOT / path).exists()


def test_the_example_waits_for_the_participant_of_the_tutorial() -> None:
    (command,) = re.findall(r"^    awk (.*?)>/tmp/lockstep.yaml$", SCRIPT, re.DOTALL | re.MULTILINE)
    printed = subprocess.run(
        ["bash", "-c", f"package={ROOT}; awk {command}"], capture_output=True, text=True, check=True
    ).stdout
    assert "my_stack" in yaml.safe_load(printed)["graph"]["participants"]
    assert 'Node("my_stack")' in (ROOT / "examples/my_stack_cpp/src/my_stack.cpp").read_text()


def test_named_interfaces_exist() -> None:
    named = re.findall(r"simbev_interfaces/(\w+/\w+)", SCRIPT)
    assert named and all((ROOT / "interfaces" / f"{name}.msg").is_file() for name in named)
