"""Optional parts of the installation, pip's extras: which of them are there, and the command that adds one.

The base installation reads, checks, evaluates and exports datasets. Everything else is an extra of ``setup.py``.
"""

import json
import shlex
import sys
from collections.abc import Mapping
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
        if self.missing:
            raise InputError(self.remedy(user))

    def remedy(self, user: str) -> str:
        """Message that something needs the extra, with the command that installs it."""
        return f"{user} needs {self.use}; install it: {install_command(self.name)}"


@lru_cache
def load_extras() -> Mapping[str, Extra]:
    """The extras that users choose, by name."""
    from simbev_ros.foundation.tables import load_table  # the command line starts without it

    table = load_table("simbev_ros.foundation.installation", "extras.yaml")
    return MappingProxyType({name: Extra(name, entry["use"], tuple(entry["modules"])) for name, entry in table.items()})


def extra_of(error: ImportError) -> Extra | None:
    """The extra that brings the module that could not be imported; None if no extra does, or it is there but broken."""
    module = (error.name or "").partition(".")[0]
    if not isinstance(error, ModuleNotFoundError):
        return None
    return next((extra for extra in load_extras().values() if module in extra.modules), None)


def install_command(extra: str) -> str:
    """Command that adds an extra to this installation, from where simbev_ros itself was installed from."""
    return f"{shlex.quote(sys.executable)} -m pip install {_requirement(extra)}"


def _requirement(extra: str) -> str:
    try:
        record = metadata.distribution(PACKAGE).read_text("direct_url.json")
    except metadata.PackageNotFoundError:  # runs from its sources
        return f"-e {shlex.quote(f'{_CHECKOUT}[{extra}]')}"
    if record is None:  # from an index
        return shlex.quote(f"{PACKAGE}[{extra}]")
    origin = json.loads(record)
    url = urlsplit(origin["url"])
    if url.scheme == "file":
        editable = "-e " if origin.get("dir_info", {}).get("editable") else ""
        return f"{editable}{shlex.quote(f'{unquote(url.path)}[{extra}]')}"
    control = origin.get("vcs_info", {})
    address = f"{control['vcs']}+{origin['url']}@{control['commit_id']}" if control else origin["url"]
    return shlex.quote(f"{PACKAGE}[{extra}] @ {address}")
