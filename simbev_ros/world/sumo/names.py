"""Names of vehicles and pedestrians in SUMO, from their index in the scene's specification, and back."""


def vehicle_name(index: int) -> str:
    """SUMO's id of a vehicle of the specification."""
    return f"v{index}"


def pedestrian_name(index: int) -> str:
    """SUMO's id of a pedestrian of the specification."""
    return f"p{index}"


def index_of(name: str) -> int:
    """Index in the specification of a vehicle's or pedestrian's name."""
    return int(name[1:])
