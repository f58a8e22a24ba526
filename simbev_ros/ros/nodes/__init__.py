"""The ROS nodes of the graph: each callback receives, calls one pure function, converts the result and publishes it.

The world node plays a scene tick by tick. Sensor nodes and the annotator turn each tick's state into measurements and
labels, the recorder writes them into a bag, and the evaluator compares the answers of a perception stack with the
labels. ``main`` runs one or several of them in a process.
"""

from simbev_ros.foundation.installation.shell_variables import prepare_node

prepare_node()
