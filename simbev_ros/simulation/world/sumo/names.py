"""SUMO ids of vehicles and pedestrians, derived from their index in the scene's specification, and the inverse."""


def vehicle_name(index: int) -> str:
    """SUMO id of the specification's vehicle with this index."""
    return f"v{index}"


def pedestrian_name(index: int) -> str:
    """SUMO id of the specification's pedestrian with this index."""
    return f"p{index}"


def index_of(name: str) -> int:
    """Index in the specification of the vehicle or pedestrian with this SUMO id."""
    return int(name[1:])
