from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.schema.boxes import blank_boxes
from simbev_ros.schema.nuscenes import attributes_of
from simbev_ros.schema.scene.state import Behavior


def test_parked_vehicles_have_nuscenes_attribute_of_their_own() -> None:
    boxes = blank_boxes(4)
    boxes["id"], boxes["class"] = [1, 2, 3, 4], BOX_CLASSES.index("car")
    boxes["behavior"][1] = Behavior.PARKED
    boxes["vx"][3] = 2.0
    expected = [["vehicle.stopped"], ["vehicle.parked"], ["vehicle.parked"], ["vehicle.moving"]]
    assert attributes_of(boxes, ["vehicle.car"] * 4, {3}, set()) == expected


def test_people_who_sit_have_nuscenes_attribute_of_their_own() -> None:
    boxes = blank_boxes(3)
    boxes["id"], boxes["class"] = [1, 2, 3], BOX_CLASSES.index("pedestrian")
    boxes["behavior"][1] = Behavior.SITTING
    boxes["vy"][2] = 1.0
    expected = [["pedestrian.standing"], ["pedestrian.sitting_lying_down"], ["pedestrian.moving"]]
    assert attributes_of(boxes, ["human.pedestrian.adult"] * 3, set(), set()) == expected
