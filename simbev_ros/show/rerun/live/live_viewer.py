"""Shows the graph of a ROS domain in Rerun: server, node and drawing in one process, each in threads of its own."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import rclpy
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import try_shutdown

from simbev_ros.ros.conventions.arguments import PLAIN, RosArguments
from simbev_ros.ros.nodes.spinning import spinning
from simbev_ros.show.rerun.live.graph_drawing import GraphDrawing
from simbev_ros.show.rerun.live.graph_reader import GraphReader
from simbev_ros.show.rerun.live.live_observer import LiveObserver
from simbev_ros.show.rerun.live.newest_frame import NewestFrame
from simbev_ros.show.rerun.server import ViewerServer
from simbev_ros.show.rerun.subject import Detail


class LiveViewer:
    """A viewer that runs.

    Args:
        server: Rerun's server.
        reader: The node.
        drawing: The thread that draws.
    """

    def __init__(self, server: ViewerServer, reader: GraphReader, drawing: GraphDrawing) -> None:
        self._server, self._reader, self._drawing = server, reader, drawing

    @property
    def page_url(self) -> str:
        """Address of the viewer's page."""
        return self._server.page_url

    def require_running(self) -> None:
        """Raise what has ended a part of it.

        Raises:
            SimbevError: Rerun's server has ended.
            InputError: A scene does not have the agent that is shown.
        """
        self._server.require_running()
        self._reader.raise_failure()
        self._drawing.raise_failure()


@contextmanager
def running_viewer(
    place: tuple[int, str],
    rate_hz: float,
    detail: Detail,
    observer: LiveObserver,
    ros: RosArguments = PLAIN,
    agent: str | None = None,
) -> Iterator[LiveViewer]:
    """Show the graph of the environment's domain for as long as the context is open.

    Args:
        place: Port and address to listen on.
        rate_hz: Maximum number of frames per second of wall time.
        detail: How much is shown; beyond its limit of memory, the earliest is dropped.
        observer: Receives what happens.
        ros: ROS arguments for the nodes of the graph, and its namespace.
        agent: Name of the agent that is shown; None: the first one of each scene.

    Raises:
        InputError: The port cannot be used.
        SimbevError: Rerun's server does not start.
    """
    frames = NewestFrame()
    drawing = GraphDrawing(frames, detail, observer)
    with ExitStack() as stack:
        stack.callback(drawing.join)  # last: a thread that waits for a stalled server ends with the server
        server = stack.enter_context(ViewerServer(*place, int(detail.limit_bytes)))
        stack.callback(drawing.end)
        drawing.start(server.data_url)
        rclpy.init(args=ros.for_nodes, signal_handler_options=SignalHandlerOptions.NO)
        stack.callback(try_shutdown)
        reader = GraphReader(
            frames, rate_hz, layers=detail.layers, observer=observer, namespace=ros.namespace, agent=agent
        )
        stack.callback(reader.destroy_node)
        stack.enter_context(spinning(reader))
        yield LiveViewer(server, reader, drawing)
