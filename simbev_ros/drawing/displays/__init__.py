"""Messages that exist to be looked at: markers, paths, grids and pictures, made from states, tables and records.

All functions return serialized messages (CDR). Publishers send them as they are, and a server of bags makes the same
bytes from recorded messages. Pure: imports no ROS.
"""
