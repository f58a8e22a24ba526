"""Topic names, QoS, and arrays to and from messages."""
