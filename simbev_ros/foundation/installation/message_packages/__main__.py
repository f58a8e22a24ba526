"""Makes and installs the missing message packages for ``./simbev``, as ``python -m`` with the name of this package.

It prints each package, and one line if something is missing. With names of ``ON_DEMAND``, it makes those.
"""

import sys

from simbev_ros.foundation.errors import SimbevError
from simbev_ros.foundation.installation.message_packages.definitions import MESSAGE_PACKAGES, ON_DEMAND
from simbev_ros.foundation.installation.message_packages.installer import install_missing


def main() -> int:
    """Make what is missing; return the exit code."""
    packages = [each for name in sys.argv[1:] for each in ON_DEMAND[name]] or MESSAGE_PACKAGES
    try:
        made = install_missing(lambda package: print(f"making {package.name}", flush=True), packages)
    except SimbevError as error:
        print(f"error: {error}", file=sys.stderr)
        return error.exit_code
    print(f"made: {', '.join(package.name for package in made) or 'nothing, all are there'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
