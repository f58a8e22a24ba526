"""Nodes that turn our messages into those that other stacks read, where remapping a topic is not enough.

Run one with the graph: ``python -m simbev_ros.ros.relays.autoware`` or ``python -m simbev_ros.ros.relays.nav2``.
"""
