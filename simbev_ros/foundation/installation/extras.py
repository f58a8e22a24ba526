"""Optional parts of the installation, pip's extras: which of them are there, and the command that adds one.

The base installation reads, checks, evaluates and exports datasets. Everything else is an extra of ``setup.py``.
"""

import json
import os
import shlex
import sys
from collections.abc import Mapping, Sequence
from functools import lru_cache
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple
from urllib.parse import unquote, urlsplit

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.installation.shipped_files import PACKAGE

_CHECKOUT = Path(__file__).resolve().parents[3]


class Extra(NamedTuple):
    """An extra of ``setup.py``.

    Attributes:
        name: Its name there.
        use: What it is, in words that follow "needs".
        modules: The modules that its requirements bring.
    """

    name: str
    use: str
    modules: tuple[str, ...]

    @property
    def missing(self) -> tuple[str, ...]:
        """The modules that are not installed."""
        return tuple(module for module in self.modules if find_spec(module) is None)

    def require(self, user: str) -> None:
        """Check that the extra is installed.

        Args:
            user: What needs it, for the message.

        Raises:
            InputError: It is not; the message has the command that installs it.
        """
        require_extras((self.name,), user)

    def remedy(self, user: str) -> str:
        """Message that something needs the extra, with the command that installs it."""
        return _remedy((self,), user)


@lru_cache
def load_extras() -> Mapping[str, Extra]:
    """The extras that users choose, by name."""
    from simbev_ros.foundation.tables import load_table  # the command line starts without it

    table = load_table("simbev_ros.foundation.installation", "extras.yaml")
    return MappingProxyType({name: Extra(name, entry["use"], tuple(entry["modules"])) for name, entry in table.items()})


def require_extras(names: Sequence[str], user: str) -> None:
    """Check that several extras are installed. Arguments and errors are those of ``Extra.require``."""
    missing = [load_extras()[name] for name in names if load_extras()[name].missing]
    if missing:
        raise InputError(_remedy(missing, user))


def _remedy(missing: Sequence[Extra], user: str) -> str:
    use, pronoun = " and ".join(extra.use for extra in missing), "it" if len(missing) == 1 else "them"
    return f"{user} needs {use}; install {pronoun}: {install_command(*(extra.name for extra in missing))}"


def extra_of(error: ImportError) -> Extra | None:
    """The extra that brings the module that could not be imported; None if no extra does, or it is there but broken."""
    module = (error.name or "").partition(".")[0]
    if not isinstance(error, ModuleNotFoundError):
        return None
    return next((extra for extra in load_extras().values() if module in extra.modules), None)


def install_command(*extras: str) -> str:
    """Command that adds extras to this installation: the set-up that made it, or pip, from where it was installed."""
    if command := os.environ.get("SIMBEV_COMMAND"):
        return f"{shlex.quote(command)} setup {','.join(extras)}"
    return f"{shlex.quote(sys.executable)} -m pip install {_requirement(','.join(extras))}"


def _requirement(extras: str) -> str:
    try:
        record = metadata.distribution(PACKAGE).read_text("direct_url.json")
    except metadata.PackageNotFoundError:  # runs from its sources
        return f"-e {shlex.quote(f'{_CHECKOUT}[{extras}]')}"
    if record is None:  # from an index
        return shlex.quote(f"{PACKAGE}[{extras}]")
    origin = json.loads(record)
    url = urlsplit(origin["url"])
    if url.scheme == "file":
        editable = "-e " if origin.get("dir_info", {}).get("editable") else ""
        return f"{editable}{shlex.quote(f'{unquote(url.path)}[{extras}]')}"
    control = origin.get("vcs_info", {})
    address = f"{control['vcs']}+{origin['url']}@{control['commit_id']}" if control else origin["url"]
    return shlex.quote(f"{PACKAGE}[{extras}] @ {address}")
