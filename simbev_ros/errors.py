"""The exception tree. The command line maps each branch to an exit code and prints the message without a traceback."""

import struct
import tokenize
import zipfile
import zlib

NPZ_DAMAGE = (
    *(ValueError, LookupError, OSError, EOFError, RuntimeError, MemoryError, SyntaxError, TypeError),
    *(struct.error, tokenize.TokenError, zipfile.BadZipFile, zlib.error),
)
"""What numpy raises on NPY and NPZ files that are damaged, wherever the damage is."""


class SimbevError(Exception):
    """Something failed although the input was good. Exit code 1."""

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


class GraphError(SimbevError):
    """A node died, fell silent or could not start; the message names it. Exit code 1."""


class SimulationError(SimbevError):
    """The traffic simulation could not start or go on. Exit code 1."""


class DiskError(SimbevError):
    """The disk is full, or nearly, or fails: nothing more can be recorded. Exit code 1."""


class RenderError(InputError):
    """This machine, as it is set up, cannot draw what is asked for; the message says what to do. Exit code 2."""


class BagError(InputError):
    """A bag is missing, damaged, or not one of ours. Exit code 2."""
