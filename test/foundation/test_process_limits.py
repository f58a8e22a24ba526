"""A limit of address space in which a graph cannot run is found before it starts."""

import resource

import pytest

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.process_memory import require_address_space


@pytest.mark.parametrize("limit_bytes", [1200000 << 10, 0])
def test_a_low_limit_is_refused(monkeypatch: pytest.MonkeyPatch, limit_bytes: int) -> None:
    monkeypatch.setattr(resource, "getrlimit", lambda _: (limit_bytes, resource.RLIM_INFINITY))
    with pytest.raises(InputError, match=r"memory is short: .* GiB of address space \(ulimit -v\)"):
        require_address_space()


@pytest.mark.parametrize("limit_bytes", [4 << 30, resource.RLIM_INFINITY])
def test_a_high_or_no_limit_is_fine(monkeypatch: pytest.MonkeyPatch, limit_bytes: int) -> None:
    monkeypatch.setattr(resource, "getrlimit", lambda _: (limit_bytes, resource.RLIM_INFINITY))
    require_address_space()
