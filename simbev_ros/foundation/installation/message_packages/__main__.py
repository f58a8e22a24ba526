"""Makes and installs the missing message packages for ``./simbev``, as ``python -m`` with the name of this package.

It prints each package, and one line if something is missing. With ``autoware``, it makes those of Autoware's relay.
"""

import sys

from simbev_ros.foundation.errors import SimbevError
from simbev_ros.foundation.installation.message_packages.definitions import AUTOWARE_MESSAGES, MESSAGE_PACKAGES
from simbev_ros.foundation.installation.message_packages.installer import install_missing


def main() -> int:
    """Make what is missing; return the exit code."""
    packages = AUTOWARE_MESSAGES if sys.argv[1:] == ["autoware"] else MESSAGE_PACKAGES
    try:
        made = install_missing(lambda package: print(f"making {package.name}", flush=True), packages)
    except SimbevError as error:
        print(f"error: {error}", file=sys.stderr)
        return error.exit_code
    print(f"made: {', '.join(package.name for package in made) or 'nothing, all are there'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
