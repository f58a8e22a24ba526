"""Processes that share a machine plan with fewer cores than they may use."""

import os

import pytest

from simbev_ros.foundation.threads import CORES_VARIABLE, usable_cores


def test_a_parent_lowers_the_number_of_cores_but_does_not_raise_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(CORES_VARIABLE, raising=False)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(6)))
    found = [usable_cores()]
    for cores in ("2", "6", "99"):
        monkeypatch.setenv(CORES_VARIABLE, cores)
        found.append(usable_cores())
    assert found == [6, 2, 6, 6]
