"""Write every generated page of docs/, or with ``--check`` name those that are out of date."""

import sys

from tools.docs.pages import stale_pages, write_pages


def main() -> int:
    """Exit code 1 if ``--check`` finds a page that is out of date."""
    if sys.argv[1:] == ["--check"]:
        stale = stale_pages()
        for path in stale:
            print(f"{path}: out of date; run python -m tools.docs")
        return 1 if stale else 0
    for path in write_pages():
        print(f"wrote {path}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
