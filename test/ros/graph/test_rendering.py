"""A machine that cannot draw as configured leads to one message that says what to do, and exit code 2."""

import pytest
from commands import Command, Config, Simbev

pytestmark = [pytest.mark.graph, pytest.mark.slow]


def refusal(command: Command) -> str:
    """The only error message of a command."""
    code, output = command.finish()
    assert code == 2, output
    assert "Traceback" not in output and output.count("error: ") == 1
    return output.partition("error: ")[2]


def test_without_egl_the_message_says_what_to_install(
    simbev: Simbev, small_config: Config, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_FILENAMES", "/nonexistent")
    message = refusal(simbev("run", small_config(600, without=["lidar", "radar"])))
    assert message.startswith("EGL has no device to render on")
    assert "__EGL_VENDOR_LIBRARY_FILENAMES=/nonexistent" in message and "apt install libegl1" in message


def test_a_missing_gpu_is_named_with_the_available_ones(simbev: Simbev, small_config: Config) -> None:
    config = small_config(600, "rendering: {gpus: [77], processes: 2}\n", without=["lidar", "radar", "gnss", "imu"])
    message = refusal(simbev("run", config))
    assert message.startswith("node camera: rendering.gpus: EGL has no device 77; it has 0 (")
    assert "rendering.gpus: []" in message


def test_low_quality_rendering_on_the_cpu_plays_a_scene(simbev: Simbev, small_config: Config) -> None:
    code, output = simbev("run", small_config(0.5, "rendering: {gpus: [], quality: low}\n")).finish()
    assert code == 0, output
