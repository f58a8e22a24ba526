"""Nodes that turn our messages into those that other stacks read, where remapping a topic is not enough.

Run one with the graph: ``python -m simbev_ros.ros.relays.autoware`` or ``python -m simbev_ros.ros.relays.nav2``.
"""

import sys

from simbev_ros.foundation.installation.import_order import put_own_packages_first
from simbev_ros.foundation.installation.shell_variables import prepare_shell

if sys.argv[0] == "-m":  # before a relay loads ROS: users of Autoware choose a middleware that ROS from wheels lacks
    put_own_packages_first()
    prepare_shell()
