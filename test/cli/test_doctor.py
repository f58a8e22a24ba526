"""``simbev doctor`` says of every EGL device whether it draws, or why not."""

import re
import sys
from typing import Any

import pytest

from simbev_ros.foundation.errors import RenderError
from simbev_ros.foundation.installation import system_libraries
from simbev_ros.simulation.render.gl import context
from simbev_ros.simulation.render.gl.context import Survey
from simbev_ros.simulation.render.gl.devices import EglDevice

H200, MESA = EglDevice(0, "NVIDIA H200", software=False), EglDevice(2, "Mesa's software renderer", software=True)


@pytest.fixture(autouse=True)
def no_missing_libraries(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out the search for libraries of the system, which takes long and has its own tests."""
    monkeypatch.setattr(system_libraries, "find_missing_libraries", list)


def lines(answer: Any) -> dict[str, str]:
    """Part → what was found, with its mark."""
    rows = (line.split("  ") for line in answer.out.splitlines())
    words = ([word.strip() for word in row if word.strip()] for row in rows)
    return {row[1]: f"{row[0]} {row[2]}" for row in words if len(row) == 3}


def test_gpus_are_used_the_cpu_is_in_reserve_and_what_cannot_be_used_has_its_reason(
    simbev: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    broken = EglDevice(1, "AMD", software=False)
    surveys = [Survey(H200, "H200, OpenGL 4.6", None), Survey(broken, None, "no right"), Survey(MESA, "llvmpipe", None)]
    monkeypatch.setattr(context, "survey_devices", lambda: surveys)
    monkeypatch.setattr(context, "describe_renderer", lambda: "H200, OpenGL 4.6")
    found = lines(simbev("doctor"))
    assert found["renderer"] == "✓ H200, OpenGL 4.6"
    assert found["EGL device 0"] == "· used: H200, OpenGL 4.6"
    assert found["EGL device 1"] == "· AMD: no right"
    assert found["EGL device 2"] == "· in reserve, there is a GPU: llvmpipe"


def test_a_machine_without_egl_fails(simbev: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def missing() -> str:
        raise RenderError("no EGL. Install Mesa")

    monkeypatch.setattr(context, "survey_devices", missing)
    monkeypatch.setattr(context, "describe_renderer", missing)
    answer = simbev("doctor")
    assert answer.code == 1
    assert lines(answer)["renderer"] == "✗ no EGL. Install Mesa"


def test_variables_of_the_shell_that_matter_have_a_row(simbev: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("RMW_IMPLEMENTATION", "ROS_DISCOVERY_SERVER"):
        monkeypatch.setenv(name, "rmw_none_cpp")
    found = lines(simbev("doctor"))
    assert found["RMW_IMPLEMENTATION"].startswith("· rmw_none_cpp: dropped: this ROS has only ")
    assert found["ROS_DISCOVERY_SERVER"].startswith("· rmw_none_cpp: dropped: ")
    assert found["ROS 2"].startswith("✓ ")


def test_without_ros_the_command_that_installs_it_is_said(simbev: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    for module in [name for name in sys.modules if name.partition(".")[0] in {"rclpy", "rosidl_adapter"}]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "rclpy", None)
    monkeypatch.setitem(sys.modules, "rosidl_adapter", None)
    answer = simbev("doctor")
    assert answer.code == 1
    assert lines(answer)["ROS 2"].startswith("✗ not installed: ")
    assert "pip install" in simbev("env").err


def test_a_loopback_interface_that_is_down_fails(simbev: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("simbev_ros.cli.doctor.loopback_problem", lambda: "the loopback interface is down")
    answer = simbev("doctor")
    assert answer.code == 1 and re.search("✗ +network +the loopback interface is down", answer.out)
