"""Continuous integration runs a failed test once more, with new fixtures, and names it as flaky."""

import subprocess
import sys
from pathlib import Path

SUPPORT = Path(__file__).parents[2] / "test/support"
TESTS = """
import pytest
from pathlib import Path

RUNS = Path(__file__).with_suffix(".runs")


def count() -> int:
    with RUNS.open("a") as file:
        file.write("x")
    return len(RUNS.read_text())


@pytest.fixture(scope="SCOPE")
def recorded():
    number = count()
    assert number != 1 or "SETUP" != "fails", "no recording"
    yield number
    assert number != 1 or "TEARDOWN" != "fails", "leftovers"


def test_of_a_recording(recorded):
    assert recorded != 1 or "CALL" != "fails", "half a recording"


def test_of_something_else():
    pass
"""


def outcome(tmp_path: Path, **texts: str) -> tuple[int, str]:
    """Exit code and output of pytest with the plugin, on files with these texts."""
    for name, text in texts.items():
        (tmp_path / f"test_{name}.py").write_text(text)
    command = [sys.executable, "-m", "pytest", "-p", "retry_failed", "-p", "no:cacheprovider", "-c", "/dev/null", "-q"]
    done = subprocess.run(
        [*command, "--rootdir", str(tmp_path), str(tmp_path)],
        env={"PYTHONPATH": str(SUPPORT), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    return done.returncode, done.stdout + done.stderr


def test_a_test_that_fails_once_passes_and_is_listed_as_flaky_whatever_failed(tmp_path: Path) -> None:
    kinds = [(failing, scope) for failing in ("SETUP", "CALL") for scope in ("function", "module", "session")]
    kinds += [("TEARDOWN", "function"), ("TEARDOWN", "module")]
    texts = {f"{a}_{b}": TESTS.replace(f'"{a}"', '"fails"').replace("SCOPE", b) for a, b in kinds}
    code, output = outcome(tmp_path, **texts)
    assert code == 0 and f"{2 * len(kinds)} passed" in output and f"{len(kinds)} flaky: " in output, output
    for failing, scope in kinds:
        last = (failing, scope) == ("TEARDOWN", "module")
        name = "test_of_something_else" if last else "test_of_a_recording"
        assert f"FLAKY test_{failing}_{scope}.py::{name}\n" in output
    assert all(words in output for words in ("no recording", "half a recording", "leftovers"))


def test_a_test_that_fails_twice_fails_and_others_run_once(tmp_path: Path) -> None:
    failing = "def test_a():\n    assert 1 == 2\n\ndef test_b():\n    pass\n"
    others = "import pytest\n\n@pytest.mark.xfail\ndef test_a():\n    assert 0\n\n"
    others += "def test_b():\n    pytest.skip('not here')\n"
    code, output = outcome(tmp_path, failing=failing, others=others)
    assert code == 1 and "1 failed, 1 passed, 1 skipped, 1 xfailed" in output and "flaky" not in output
