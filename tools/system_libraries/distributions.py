"""Finds the installed Python distributions that a distribution requires, directly or through others."""

from collections.abc import Callable, Iterable, Iterator
from importlib import metadata
from pathlib import Path, PurePath

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name


class DistributionGraph:
    """The installed distributions that a root distribution with some extras requires, and how they require each other.

    Attributes:
        distributions: By canonical name, the root included. Requirements that are not installed are left out.
    """

    def __init__(self, root: str, extras: Iterable[str]) -> None:
        """Walk the requirements of ``root[extras]``.

        Raises:
            importlib.metadata.PackageNotFoundError: ``root`` is not installed.
        """
        root = canonicalize_name(root)
        self.distributions: dict[str, metadata.Distribution] = {root: metadata.distribution(root)}
        self._requires: dict[str, set[str]] = {root: set()}
        waiting = [(root, extra) for extra in ("", *extras)]
        seen = set(waiting)
        while waiting:
            name, extra = waiting.pop()
            for requirement in _requirements(self.distributions[name], extra):
                required = canonicalize_name(requirement.name)
                if not self._add(required):
                    continue
                self._requires[name].add(required)
                new = {(required, extra) for extra in ("", *requirement.extras)} - seen
                seen |= new
                waiting += sorted(new)

    def _add(self, name: str) -> bool:
        """Whether the distribution is installed."""
        if name not in self.distributions:
            try:
                self.distributions[name] = metadata.distribution(name)
            except metadata.PackageNotFoundError:
                return False
            self._requires[name] = set()
        return True

    def required_by(self, name: str) -> set[str]:
        """Canonical names of all that ``name`` requires, itself included."""
        found = {name}
        waiting = [name]
        while waiting:
            new = self._requires[waiting.pop()] - found
            found |= new
            waiting += new
        return found

    def find_files(self, is_wanted: Callable[[PurePath], bool]) -> dict[Path, str]:
        """Installed files that are wanted by their recorded path → canonical name of their distribution."""
        return {
            Path(str(file.locate())).resolve(): name
            for name, distribution in self.distributions.items()
            for file in distribution.files or ()
            if is_wanted(file)
        }


def _requirements(distribution: metadata.Distribution, extra: str) -> Iterator[Requirement]:
    """Requirements that apply on this machine; those of the extra alone if one is named."""
    for line in distribution.requires or ():
        requirement = Requirement(line)
        if requirement.marker is None:
            applies = not extra
        else:
            without_extra = requirement.marker.evaluate({"extra": ""})
            applies = requirement.marker.evaluate({"extra": extra}) and (not extra or not without_extra)
        if applies:
            yield requirement
