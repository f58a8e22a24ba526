"""Pages of docs/extending that are followed step by step in a copy of the package."""

import os
import re
import shutil
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

ROOT = Path(__file__).parents[2]
_STEP = re.compile(r"^## \d\. [^\n]*`([\w/.]+\.\w+)`\n.*?^```(\w+)\n(.*?)^```", re.DOTALL | re.MULTILINE)


class FollowedPage:
    """A page, and a copy of the package in which its steps can be done.

    Each step is a section whose heading names a file; its first block of code is a diff, or the whole new file.

    Attributes:
        text: The page.
        steps: File, kind of block and block of each step.
        copy: Folder of the copy.
    """

    def __init__(self, page: str, copy: Path) -> None:
        self.text = (ROOT / "docs/extending" / page).read_text(encoding="utf-8")
        self.steps = _STEP.findall(self.text)
        self.copy = copy
        shutil.copytree(ROOT / "simbev_ros", copy / "simbev_ros", copy_function=os.symlink)
        shutil.copytree(ROOT / "interfaces", copy / "interfaces", copy_function=os.symlink)
        shutil.copytree(ROOT / "config", copy / "config", copy_function=os.symlink)
        for name in ("test", "setup.cfg", "ruff.toml", "package.xml"):
            (copy / name).symlink_to(ROOT / name)
        # It finds the interfaces beside the place where it really lies.
        finder = copy / "simbev_ros/foundation/installation/shipped_files.py"
        finder.unlink()
        shutil.copy(ROOT / finder.relative_to(copy), finder)

    @property
    def files(self) -> list[str]:
        """Files of the steps."""
        return [file for file, _, _ in self.steps]

    def follow(self, *numbers: int) -> None:
        """Do these steps, counted from 1; all without a number."""
        for file, kind, text in (self.steps[number - 1] for number in numbers or range(1, len(self.steps) + 1)):
            path = self.copy / file
            changed = patched(path.read_text(encoding="utf-8"), text) if kind == "diff" else text
            assert kind == "diff" or not path.exists(), f"{path} is to be new"
            path.unlink(missing_ok=True)
            path.write_text(changed, encoding="utf-8")

    def row(self, of: str) -> str:
        """The page's list of checks that complain if something is forgotten."""
        (found,) = re.findall(rf"^\| {of} \| (.*) \|$", self.text, re.MULTILINE)
        return str(found)

    def checks(self, of: str) -> set[str]:
        """The tests that the page names for what is forgotten."""
        return set(re.findall(r"test/[\w/]+\.py::\w+", self.row(of)))

    def run(self, *words: object) -> subprocess.CompletedProcess[str]:
        """Run Python with these words in the copy."""
        environment = {**os.environ, "PYTHONPATH": str(self.copy), "PYTHONDONTWRITEBYTECODE": "1"}
        command = [sys.executable, *map(str, words)]
        return subprocess.run(command, cwd=self.copy, env=environment, capture_output=True, text=True, timeout=300)

    def mypy_errors(self, *files: object) -> set[tuple[str, str]]:
        """File and text of the errors in files of the copy."""
        with suppress(FileNotFoundError):  # there is none before the package is first checked; mypy takes longer then
            shutil.copytree(ROOT / ".mypy_cache", self.copy / ".mypy_cache")
        result = self.run("-m", "mypy", *files)
        assert result.returncode in (0, 1), result.stdout + result.stderr
        line = r"^(?:.*/)?(simbev_ros/[\w/]+\.py):\d+: error: (.*?)(?:  \[.*)?$"
        return set(re.findall(line, result.stdout, re.MULTILINE))

    def failures(self, *files: str, only: str = "") -> set[str]:
        """The tests that fail in the copy, without their parameters."""
        options = ("-q", "-p", "no:cacheprovider", "-k", only, "--rootdir", self.copy)
        result = self.run("-m", "pytest", *options, *(self.copy / name for name in files))
        assert result.returncode in (0, 1), result.stdout + result.stderr
        found = re.findall(r"^(?:FAILED|ERROR) (?:.*/)?test/([\w/]+\.py::\w+)", result.stdout, re.MULTILINE)
        return {f"test/{name}" for name in found}

    def require_lint(self) -> None:
        """Fail if ruff complains of a Python file of the steps."""
        for words in (("check",), ("format", "--check")):
            result = self.run("-m", "ruff", *words, *(file for file in self.files if file.endswith(".py")))
            assert result.returncode == 0, result.stdout + result.stderr


def patched(before: str, diff: str) -> str:
    """A text with the changes of a diff, whose parts are each found once."""
    for part in diff.split("@@\n"):
        lines = part.splitlines(keepends=True)
        old, new = ("".join(line[1:] or "\n" for line in lines if line[0] in marks) for marks in (" -\n", " +\n"))
        assert before.count(old) == 1, f"the page's diff does not fit: {old!r}"
        before = before.replace(old, new)
    return before
