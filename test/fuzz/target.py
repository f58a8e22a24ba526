"""A target of fuzzing: a reader of foreign bytes as a function, with the errors that it documents and its corpus."""

import atexit
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import mutation

CORPUS = Path(__file__).parent / "corpus"
GROWN = 75
"""Exit code of a fuzzing process that many inputs together have made too large; one input that does so is a find."""


@dataclass(frozen=True)
class Target:
    """A reader of foreign bytes.

    Attributes:
        name: Its name; that of its corpus too.
        read: Reads bytes and checks the result.
        errors: Exceptions that the reader documents.
        mutate: Mutator that fits its format.
        examples: Number of mutations in a test run that takes about a second.
        corpus: Name of the corpus, if it is that of another target.
    """

    name: str
    read: Callable[[bytes], None]
    errors: tuple[type[Exception], ...]
    mutate: mutation.Mutator = mutation.mutate_bytes
    examples: int = 100
    corpus: str = ""

    @property
    def folder(self) -> Path:
        """Folder of the corpus: valid samples, called ``valid…``, and inputs that were faults once."""
        return CORPUS / (self.corpus or self.name)

    def samples(self, pattern: str = "*") -> dict[str, bytes]:
        """Content of the corpus by the names of its files, sorted."""
        return {path.name: path.read_bytes() for path in sorted(self.folder.glob(pattern))}

    def run(self, data: bytes) -> None:
        """Read bytes that may be anything; raises only what is a fault."""
        try:
            self.read(data)
        except self.errors as error:
            assert str(error), "an error without a message"


@cache
def folder() -> Path:
    """Folder for the files of all targets, removed at the end of the process."""
    made = tempfile.TemporaryDirectory(prefix="simbev-fuzzing-")
    atexit.register(made.cleanup)
    return Path(made.name)


def write_file(name: str, data: bytes) -> Path:
    """Write a file, which replaces the one before."""
    path = folder() / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
    return path
