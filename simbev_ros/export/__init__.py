"""Exports of datasets to the layouts of other projects. Needs neither ROS nor a GPU."""
