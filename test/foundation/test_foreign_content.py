"""Whatever a reader raises over foreign content becomes one line that names where it comes from."""

import struct
import zipfile

import pytest

from simbev_ros.foundation.errors import BagError, InputError, foreign_content

KINDS = [ValueError, TypeError, KeyError, IndexError, OverflowError, ZeroDivisionError, RecursionError, MemoryError]
KINDS += [
    AttributeError,
    AssertionError,
    EOFError,
    OSError,
    RuntimeError,
    struct.error,
    zipfile.BadZipFile,
]


@pytest.mark.parametrize("kind", KINDS)
def test_every_error_of_a_reader_becomes_one_line(kind: type[Exception]) -> None:
    with (
        pytest.raises(InputError, match=r"^a\.onnx: metadata: cannot be read: \S") as caught,
        foreign_content("a.onnx: metadata"),
    ):
        raise kind("two\nlines " + 1000 * "x")
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 300
    with pytest.raises(InputError, match=f"cannot be read: {kind.__name__}$"), foreign_content("b"):
        raise kind


def test_messages_for_users_and_the_end_of_the_process_pass() -> None:
    with pytest.raises(BagError, match=r"^own words$"), foreign_content("a"):
        raise BagError("own words")
    with pytest.raises(KeyboardInterrupt), foreign_content("a"):
        raise KeyboardInterrupt
