"""Exception classes of the whole project.

The command line turns each class into an exit code and prints the message without a traceback.
"""

import errno
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager

FOREIGN_ERRORS = (
    *(ValueError, LookupError, TypeError, AttributeError, ArithmeticError, AssertionError),
    *(RuntimeError, MemoryError, EOFError, struct.error),
)
"""Exceptions that Python and libraries raise over content that they did not expect, after it has been read."""

NPZ_DAMAGE = (*FOREIGN_ERRORS, OSError, SyntaxError, tokenize.TokenError, zipfile.BadZipFile, zlib.error)
"""Exceptions that numpy raises when it reads a damaged NPY or NPZ file, depending on which bytes are damaged."""

_FOREIGN = (*NPZ_DAMAGE, StopIteration)
_MAX_WORDS = 200

DISK_FULL = {
    errno.ENOSPC: "the disk is full",
    errno.EDQUOT: "the disk quota is used up",
    errno.EFBIG: "the file is larger than files may be here",
}
"""Words for the numbers of the operating system's errors when there is no space for more on a disk."""

_EXHAUSTED = (*DISK_FULL, errno.EMFILE, errno.ENFILE, errno.ENOMEM)


class SimbevError(Exception):
    """Base of all errors; raised itself when something fails although the input is valid. Exit code 1."""

    exit_code = 1


class InputError(SimbevError):
    """The user's input is wrong; the message names file, field, value and what is allowed. Exit code 2.

    Args:
        problem: The message.
        parameter: Name of the function parameter with the wrong value, if there is one. It precedes the message; the
            command line puts the name of its option there instead.
    """

    exit_code = 2

    def __init__(self, problem: str = "", *, parameter: str | None = None) -> None:
        super().__init__(problem if parameter is None else f"{parameter}: {problem}")
        self.parameter = parameter


class LimitError(InputError, ValueError):
    """Foreign data exceed one of the ``limits``; the message names value and limit. Exit code 2.

    It is also a ValueError, so that readers treat it as damage where they skip or report damaged parts.
    """


class RoomError(InputError):
    """An agent of a scene finds no room where the configuration wants it. Exit code 2."""


@contextmanager
def foreign_content(source: object) -> Iterator[None]:
    """Turn whatever a reader raises over foreign content into one line that names where it comes from.

    Args:
        source: File, field or order, as the message names it.

    Raises:
        InputError: The content is damaged, hostile or too large. Errors that have a message for users stay as they are.
    """
    try:
        yield
    except LimitError as error:
        raise LimitError(f"{source}: {error}") from None
    except SimbevError:
        raise
    except _FOREIGN as error:
        if isinstance(error, OSError) and error.errno in _EXHAUSTED:
            raise
        words = " ".join(str(error).split())
        short = words if len(words) <= _MAX_WORDS else f"{words[:_MAX_WORDS]} …"
        raise InputError(f"{source}: cannot be read: {short or type(error).__name__}") from error


class GraphError(SimbevError):
    """A node died, stopped responding or could not start; the message names it. Exit code 1."""


class SimulationError(SimbevError):
    """The traffic simulation could not start or continue. Exit code 1."""


class DiskError(SimbevError):
    """The disk is full, nearly full or failing, so recording cannot continue. Exit code 1."""


class UploadError(SimbevError):
    """A finished scene could not be brought from the machine that made it to its dataset. Exit code 1."""


class RenderError(InputError):
    """This machine, as configured, cannot render what was requested; the message says what to do. Exit code 2."""


class BagError(InputError):
    """A bag is missing, damaged, or was not written by this project. Exit code 2."""
