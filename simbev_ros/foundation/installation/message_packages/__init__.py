"""ROS message packages that no wheel brings, made on this machine: those of ``definitions/``, and our own.

ROS's wheels bring the generators that ``colcon build`` runs. They write C, C++ and Python from the definitions of a
package; a compiler of this machine makes libraries of them, and pip installs the result like any other wheel. Where
ROS 2 is installed, its own packages are used and nothing is made.
"""
