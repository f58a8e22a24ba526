"""SUMO nets: building with netconvert, repair of user files, and reading."""
