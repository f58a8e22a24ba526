"""The ROS 2 graph: messages, nodes, processes, and relays to other stacks."""
