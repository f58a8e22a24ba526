"""The picture of a running graph: a ROS node reads what is drawn, joins it by ticks, and drops what comes too fast."""
