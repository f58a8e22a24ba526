"""The C++ sample of the lockstep page compiles with stand-ins of ROS's headers."""

import re
import shutil
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).parents[2]
SAMPLE = ROOT / "examples" / "my_stack_cpp"
SOURCE = (SAMPLE / "src" / "my_stack.cpp").read_text(encoding="utf-8")
CMAKE = (SAMPLE / "CMakeLists.txt").read_text(encoding="utf-8")
HEADERS = Path(__file__).parent / "rclcpp_stand_in"
COMPILER = shutil.which("g++")


def compile_sample(source: str) -> subprocess.CompletedProcess[str]:
    assert COMPILER is not None
    command = [COMPILER, "-std=c++17", "-fsyntax-only", "-Wall", "-Wextra", "-Werror", "-isystem", str(HEADERS)]
    return subprocess.run([*command, "-x", "c++", "-"], input=source, capture_output=True, text=True, check=False)


@pytest.mark.skipif(COMPILER is None, reason="there is no g++")
def test_the_sample_compiles_without_a_warning() -> None:
    result = compile_sample(SOURCE)
    assert result.returncode == 0, result.stderr


@pytest.mark.skipif(COMPILER is None, reason="there is no g++")
@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("ready_->publish(header)", "ready_->publish(header.frame_id)"),
        ("const sensor_msgs::msg::PointCloud2 & cloud)", "const std_msgs::msg::String & cloud)"),
        ("%u points", "%s points"),
    ],
    ids=["publish", "callback", "format"],
)
def test_the_stand_ins_find_faults(right: str, wrong: str) -> None:
    assert SOURCE.count(right) == 1
    assert compile_sample(SOURCE.replace(right, wrong)).returncode != 0


def test_dependencies_are_the_same_in_all_three_files() -> None:
    package = ElementTree.parse(SAMPLE / "package.xml").getroot()
    declared = {str(each.text) for each in package.iter("depend")}
    found = set(re.findall(r"find_package\((\w+) REQUIRED\)", CMAKE)) - {"ament_cmake"}
    linked = set(re.findall(r"(\w+?)(?:::\w+|_TARGETS)", CMAKE))
    included = set(re.findall(r"#include <(\w+)/", SOURCE))
    assert declared == found == linked == included
    assert package.findtext("name") == "my_stack_cpp" and "project(my_stack_cpp)" in CMAKE
