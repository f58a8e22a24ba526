"""Fingerprints of code: the part of a cache's key that stands for the program that builds the content.

A cache names the modules that build its content, and the fingerprint covers all that they can depend on: no list is
kept by hand. In doubt it covers more, since a wrong hit gives wrong labels and a needless miss costs only time.
"""

import hashlib
import sys
from functools import cache

from simbev_ros.foundation.cache.imports import follow_imports
from simbev_ros.foundation.cache.libraries import library_versions


@cache
def fingerprint(*root_modules: str) -> bytes:
    """Hash of the sources, data files and library versions that decide what modules build.

    Args:
        root_modules: Full names of the modules that build the content, such as ``simbev_ros.maps.build``.

    Returns:
        32 bytes; the same in a checkout and in an installation of the same sources.

    Raises:
        ValueError: A root module does not exist.
    """
    return hashlib.sha256(repr(sorted(fingerprint_inputs(*root_modules).items())).encode()).digest()


def fingerprint_inputs(*root_modules: str) -> dict[str, bytes]:
    """All that a fingerprint covers, for messages and tests.

    Python's minor version is part of it: from 3.12 on ``sum`` adds floats more exactly, and builders add lengths.

    Returns:
        SHA-256 or version by "module NAME", "data PATH", "library NAME" and "python".

    Raises:
        ValueError: A root module does not exist.
    """
    dependencies = follow_imports(root_modules)
    versions = library_versions(dependencies.libraries)
    return {
        "python": "{}.{}".format(*sys.version_info).encode(),
        **{f"module {name}": digest for name, digest in dependencies.modules.items()},
        **{f"data {path}": digest for path, digest in dependencies.data.items()},
        **{f"library {name}": version.encode() for name, version in versions.items()},
    }
