"""The limit of unpacked sizes, its variable, and the page that lists all limits."""

import pytest

from simbev_ros.foundation.errors import InputError, LimitError
from simbev_ros.foundation.files import limits
from simbev_ros.foundation.files.limits import MAX_UNPACKED_VARIABLE, max_unpacked_bytes, require_unpacked_size
from tools.docs.limits import described_limits


def test_a_variable_replaces_the_limit_of_unpacked_sizes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(MAX_UNPACKED_VARIABLE, raising=False)
    assert max_unpacked_bytes() == 1 << 30
    with pytest.raises(LimitError, match=r"^a file unpacks to 1,025 MiB; at most 1,024 .*_MAX_UNPACKED_MIB=1025"):
        require_unpacked_size((1 << 30) + 1, "a file")
    monkeypatch.setenv(MAX_UNPACKED_VARIABLE, "1025")
    require_unpacked_size((1 << 30) + 1)


@pytest.mark.parametrize("text", ["", "0", "-1", "1.5", "1e3", "many", "9" * 5000, "²"])
def test_a_variable_that_is_no_size_is_refused(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setenv(MAX_UNPACKED_VARIABLE, text)
    with pytest.raises(InputError, match=r"^SIMBEV_MAX_UNPACKED_MIB: is .*; allowed: a positive integer, in MiB"):
        max_unpacked_bytes()


def test_the_page_lists_every_limit() -> None:
    numbers = {name for name, value in vars(limits).items() if isinstance(value, int) and not name.startswith("_")}
    assert {name for name, _ in described_limits()} == numbers
