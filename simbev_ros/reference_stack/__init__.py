"""A small perception stack, an example for your own: it knows the graph by its public topics alone.

From each lidar cloud and the odometry at its stamp it computes 3D boxes and bird's-eye-view scores, without learning::

    cloud ─▶ ground ─▶ clusters ─▶ box_fit ─▶ readings ─▶ tracker, tracks ─▶ boxes ─▶ grid
               └──────────────────────────── road ─────────────────────────────────────▲

``pipeline`` does all of this without ROS. ``node`` connects it to the graph, with ``scene`` and ``messages``, and is a
starting point for a stack of your own. ``python -m simbev_ros.reference_stack`` runs it. ``cooperative`` is the same
stack for scenes with several agents: it merges the boxes of other agents' stacks into its own by ``fusion``. Of
simbev_ros the package imports nothing else but ``foundation.tick_join``, one file that needs nothing but Python, and
here what lets it start in shells that choose a middleware which is not installed.
"""

from simbev_ros.foundation.installation.shell_variables import prepare_node

prepare_node()
