"""Makes and installs the missing message packages for ``./simbev``, as ``python -m`` with the name of this package.

Without a compiler it says so and ends with exit code 0, since everything but some live topics works without them.
"""

import sys

from simbev_ros.errors import SimbevError
from simbev_ros.installation.message_packages.installer import find_problem, install_missing


def main() -> int:
    """Make what is missing; return the exit code."""
    if problem := find_problem():
        print(f"no message packages are made: {problem}")
        return 0
    try:
        made = install_missing(lambda package: print(f"making {package.name}", flush=True))
    except SimbevError as error:
        print(f"error: {error}", file=sys.stderr)
        return error.exit_code
    print(f"made: {', '.join(package.name for package in made) or 'nothing, all are there'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
