"""A small perception stack, as an example of yours: it knows the graph by its public topics alone.

From each lidar cloud and the odometry of its stamp it makes 3D boxes and bird's-eye-view scores, without learning::

    cloud ─▶ ground ─▶ clusters ─▶ box_fit ─▶ readings ─▶ tracker, tracks ─▶ boxes ─▶ grid
               └──────────────────────────── road ─────────────────────────────────────▲

``pipeline`` is all of that, without ROS. ``node`` connects it, with ``scene``, ``tick_join`` and ``messages``, and is
what a stack of your own can begin with. ``python -m simbev_ros.reference_stack`` runs it.
Nothing else of simbev_ros is imported.
"""
