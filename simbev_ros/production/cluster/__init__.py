"""Ray clusters: the connection to one, and work that is spread over its nodes."""
