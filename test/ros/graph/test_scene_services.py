"""Orders of strangers leave the services of a graph running, whatever they hold."""

from types import SimpleNamespace

import pytest

from simbev_ros.foundation.errors import InputError
from simbev_ros.ros.graph.scene_services import _SceneServer

REQUEST = SimpleNamespace(AS_CONFIGURED=-1, configuration="seed: 1:1", seed=-1, number=-1, interrupt=True)


@pytest.mark.parametrize("kind", [ValueError, OverflowError, RecursionError, MemoryError, KeyError, TypeError])
def test_every_error_answers_the_client(kind: type[Exception]) -> None:
    def order(*_: object, **__: object) -> None:
        raise kind("boom")

    server = object.__new__(_SceneServer)
    server._queue = SimpleNamespace(order=order)
    response = server._load(REQUEST, SimpleNamespace())
    assert response.success is False and "boom" in response.message
    with pytest.raises(InputError, match=r"^order: cannot be read: "):
        server._order(REQUEST, interrupt=False)
