"""The specification of a scene, the state of its world at a tick, and what belongs to both."""
