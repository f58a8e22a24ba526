"""Queries to dpkg's own database: the packages that others pull in, and the package that a file belongs to."""

import re
import subprocess
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path

_FIELDS = "${Package}\t${Essential}\t${Pre-Depends}, ${Depends}\t${Provides}\n"


def closure(packages: Iterable[str]) -> set[str]:
    """Installed packages that these, and the essential ones that every system has, pull in without recommendations."""
    depends, providers, essential = _database()
    found: set[str] = set()
    waiting = [*packages, *essential]
    while waiting:
        for name in providers.get(waiting.pop(), ()):
            if name not in found:
                found.add(name)
                waiting += depends[name]
    return found


def package_of(library: str) -> str | None:
    """The package that the dynamic loader's file of this name belongs to."""
    cache = subprocess.run(["/sbin/ldconfig", "-p"], capture_output=True, text=True, check=True).stdout
    paths = re.findall(rf"^\s*{re.escape(library)} \(.*x86-64.*\) => (\S+)", cache, re.MULTILINE)
    return package_of_file(Path(paths[0])) if paths else None


def package_of_file(path: Path) -> str | None:
    """The package that a file belongs to, by its name before or after the merge of /lib into /usr/lib."""
    real = str(path.resolve())
    names = (str(path), real, real.removeprefix("/usr"), f"/usr{path}")
    return next((_owners()[name] for name in names if name in _owners()), None)


@lru_cache
def _owners() -> dict[str, str]:
    """Every installed shared object → its package."""
    lists = Path("/var/lib/dpkg/info").glob("*.list")
    return {file: path.stem.split(":")[0] for path in lists for file in path.read_text().split("\n") if ".so" in file}


@lru_cache
def _database() -> tuple[dict[str, list[str]], dict[str, list[str]], list[str]]:
    """Package → names it depends on; name → packages that are or provide it; the essential packages."""
    answer = subprocess.run(["dpkg-query", "-W", f"-f={_FIELDS}"], capture_output=True, text=True, check=True)
    depends: dict[str, list[str]] = {}
    providers: dict[str, list[str]] = {}
    essential = []
    for line in answer.stdout.splitlines():
        name, is_essential, needs, provides = line.split("\t")
        depends[name] = _names(needs)
        for provided in (name, *_names(provides)):
            providers.setdefault(provided, []).append(name)
        if is_essential == "yes":
            essential.append(name)
    return depends, providers, essential


def _names(field: str) -> list[str]:
    """Names in a field of dependencies, without versions and architectures; alternatives one after the other."""
    return re.findall(r"(?:^|[,|])\s*([a-z0-9.+-]+)", field)
