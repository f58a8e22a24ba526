"""The interface through which the viewer of a running graph reports what happens."""

from typing import Protocol


class LiveObserver(Protocol):
    """Receives what happens; called from the viewer's threads."""

    def graph_noticed(self, is_there: bool) -> None:
        """It is known whether there is a graph, or one has come or gone."""

    def scene_shown(self, name: str) -> None:
        """The first frame of a scene is on Rerun's server."""

    def messages_ignored(self, reason: str) -> None:
        """Messages cannot be drawn; called once for each kind of them."""
