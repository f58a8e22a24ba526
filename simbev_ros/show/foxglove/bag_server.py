"""Serves a bag to the clients of a Foxglove WebSocket server."""

from collections.abc import Callable

from simbev_ros.foundation.errors import BagError
from simbev_ros.recording.reader import SceneBag
from simbev_ros.show.foxglove.bag_player import BagPlayer
from simbev_ros.show.foxglove.playback_clock import PlaybackClock
from simbev_ros.show.foxglove.server import Address, require_foxglove, running_server

_BACKLOG_BYTES = 512 << 20
_BACKLOG = range(128, 257)
"""Limits of the number of messages that wait for a slow client; then the oldest are dropped for it."""


def serve_bag(
    bag: SceneBag, address: Address, on_started: Callable[[Address], None], warn: Callable[[str], None]
) -> None:
    """Serve a bag until an exception, such as an interrupt, ends it.

    Args:
        bag: The bag, complete or cut off.
        address: Where to listen.
        on_started: Called with the address once clients can connect.
        warn: Called with a line for each kind of damage that is found in the bag while it is played.

    Raises:
        InputError: foxglove-sdk is not installed, or the address cannot be used.
        BagError: The bag has no messages.
    """
    require_foxglove()
    import foxglove

    start_ns, end_ns = bag.span_ns
    if end_ns == 0:
        raise BagError(f"{bag.path}: it has no messages")
    context = foxglove.Context()
    player = BagPlayer(bag, PlaybackClock(start_ns, end_ns, start_ns), context, warn)
    options = {"playback_time_range": (start_ns, end_ns), "message_backlog_size": _backlog(bag)}
    with running_server(bag.name, address, player, context, **options) as (server, used):
        on_started(used)
        player.play(server)


def _backlog(bag: SceneBag) -> int:
    """Number of messages that may wait for a client, smaller the larger the messages are."""
    sizes = [
        size / max(len(bag.topics[name].stamps_ns), 1) for name, size in bag.payload_bytes.items() if name in bag.topics
    ]
    return min(max(int(_BACKLOG_BYTES / max([*sizes, 1.0])), _BACKLOG.start), _BACKLOG.stop - 1)
