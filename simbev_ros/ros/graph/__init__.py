"""Starts, supervises and stops the processes of the ROS graph that plays scenes.

``plan`` decides which processes there are, ``process`` runs one of them, ``monitor`` follows the graph over ROS, and
``session`` puts these together: it is the class that the command line and dataset production use.
"""
