"""Locks what ./simbev installs: exact versions and hashes, of all Pythons and platforms, by extras.

``./simbev lock`` renews all files: one with ROS 2 Jazzy from wheels; one for an installed ROS 2, whose messages are
built for NumPy 1; and one with the wheels of Kilted, which take the place of Jazzy's. A comment before each requirement
names the groups that need it, by which the script chooses.
"""

import hashlib
import re
import subprocess
import tempfile
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from importlib import metadata
from pathlib import Path
from sysconfig import get_path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

FOLDER = Path(__file__).parents[1] / "simbev_ros/foundation/installation"
BASE, BUILD = "base", "build"
"""Groups of what reading datasets needs, and of what installs the rest."""
_BUILDERS = ("pip>=25", "setuptools>=71")
_OWN = ("simbev-ros", "simbev-exporters")
KILTED = "kilted"
WHOLE, WITH_ROS, OF_KILTED = "requirements.lock", "requirements-ros.lock", "requirements-kilted.lock"
VARIANTS: Mapping[str, tuple[str, ...]] = {WHOLE: (), WITH_ROS: ("numpy<2",), OF_KILTED: ()}
"""File → what narrows its versions further."""
_NOT_WITH_ROS = ("wheels", "view")
"""Extras that bring ROS, or need NumPy 2."""
_OLDEST_PYTHON = "3.11"
_NAME = re.compile(r"([A-Za-z0-9._-]+)==")
_USED = re.compile(r"^# for (.*)\n((\S+)==.*) \\$", re.MULTILINE)
"""Groups, requirement and name of an entry."""


def groups() -> dict[str, list[str]]:
    """Requirements by group, as the installed metadata of the distributions have them: extras, base and build."""
    found: dict[str, list[str]] = defaultdict(list, {BUILD: list(_BUILDERS)})
    installed = [each for name in _OWN for each in metadata.distributions(name=name, path=[get_path("purelib")])]
    for text in (text for distribution in installed for text in distribution.requires or ()):
        requirement = Requirement(text)
        extra = re.search(r'extra == "([a-z]+)"', text)
        if canonicalize_name(requirement.name) not in _OWN:
            marker = re.sub(r'(?: and )?\(?extra == "[a-z]+"\)?', "", str(requirement.marker or "")).strip()
            requirement.marker = None
            found[extra[1] if extra else BASE].append(f"{requirement} ; {marker}" if marker else str(requirement))
    return {name: sorted(found[name]) for name in sorted(found)}


def inputs_digest() -> str:
    """SHA-256 of all requirements, from which a lock is known to be stale."""
    return hashlib.sha256(repr(groups()).encode()).hexdigest()


def wanted_groups(file: str) -> dict[str, list[str]]:
    """Requirements by group that a lock file holds."""
    if file == OF_KILTED:
        return {KILTED: groups()[KILTED]}
    others = (KILTED, *_NOT_WITH_ROS) if file == WITH_ROS else (KILTED,)
    return {name: requirements for name, requirements in groups().items() if name not in others}


def locked(file: str) -> str:
    """The content of a lock file; needs the package index, and that of Kilted the first file.

    Raises:
        subprocess.CalledProcessError: The requirements contradict each other, or the index cannot be reached.
    """
    wanted = wanted_groups(file)
    everything = [each for requirements in wanted.values() for each in requirements]
    shared = _USED.findall((FOLDER / WHOLE).read_text(encoding="utf-8")) if file == OF_KILTED else ()
    base = [(name, entry) for users, entry, name in shared if {BASE, "sim"} & set(users.split())]
    limits = (*VARIANTS[file], *(entry for _, entry in base))
    entries = _entries(_compile(everything, limits, "--generate-hashes"))
    entries = {name: lines for name, lines in entries.items() if name not in {canonicalize_name(n) for n, _ in base}}
    exact = [entry.partition(" \\")[0] for lines in entries.values() for entry in lines]
    users: dict[str, list[str]] = defaultdict(list)
    for group, requirements in wanted.items():
        for name in _entries(_compile(requirements, (*exact, *limits))):
            users[name].append(group)
    head = f"# Made by ./simbev lock; do not edit.\n# inputs: {inputs_digest()}\n"
    return head + "".join(
        f"# for {' '.join(users[name])}\n{entry}\n" for name, lines in entries.items() for entry in lines
    )


def _compile(requirements: Iterable[str], constraints: Sequence[str], *options: str) -> str:
    """What uv makes of requirements, for all platforms and Pythons."""
    with tempfile.TemporaryDirectory() as folder:
        limits = Path(folder, "constraints.txt")
        limits.write_text("\n".join(constraints))
        command = ["uv", "pip", "compile", "-", "--universal", "--python-version", _OLDEST_PYTHON, "-c", str(limits)]
        quiet = ["--no-annotate", "--no-header", "--quiet", "--native-tls"]
        text = "\n".join(requirements)
        done = subprocess.run([*command, *quiet, *options], input=text, stdout=subprocess.PIPE, text=True, check=True)
    return done.stdout


def _entries(text: str) -> dict[str, list[str]]:
    """Canonical name → its requirements, each with its hashes; several where versions depend on the platform."""
    entries: dict[str, list[str]] = defaultdict(list)
    for entry in re.split(r"\n(?=\S)", text.strip()):
        if found := _NAME.match(entry):
            entries[canonicalize_name(found[1])].append(entry.rstrip())
    return entries


if __name__ == "__main__":
    for file in VARIANTS:
        (FOLDER / file).write_text(locked(file), encoding="utf-8")
        print(f"wrote {FOLDER / file}")
