"""Several observers of one production."""

from typing import Any

import pytest

from simbev_ros.production import ProductionObserver
from simbev_ros.production.observer import SeveralObservers

EVENTS = [name for name in vars(ProductionObserver) if not name.startswith("_")]


def listening(name: str, heard: list[tuple[Any, ...]]) -> ProductionObserver:
    """An observer that notes every call."""
    observer = ProductionObserver()
    for event in EVENTS:
        setattr(observer, event, lambda *arguments, event=event: heard.append((name, event, *arguments)))
    return observer


@pytest.mark.parametrize("event", EVENTS)
def test_every_call_reaches_each_observer_in_order(event: str) -> None:
    heard: list[tuple[Any, ...]] = []
    several = SeveralObservers(listening("first", heard), listening("second", heard))
    getattr(several, event)(1, "two")
    assert heard == [("first", event, 1, "two"), ("second", event, 1, "two")]
