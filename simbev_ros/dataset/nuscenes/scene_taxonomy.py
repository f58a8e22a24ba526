"""Gives the boxes of a scene their nuScenes categories and attributes, which also depend on the scene's actors."""

from simbev_ros.dataset import Frame, Scene
from simbev_ros.foundation.errors import BagError, foreign_content
from simbev_ros.foundation.types import Table
from simbev_ros.schema.nuscenes import attributes_of, categories_of
from simbev_ros.schema.scene.state import EGO_ID


class SceneTaxonomy:
    """The nuScenes categories and attributes of one scene's boxes.

    Raises:
        BagError: /world/legend or /world/actors was not recorded.
    """

    def __init__(self, scene: Scene) -> None:
        for key, known in (("world/legend", scene.constants), ("world/actors", scene.sources)):
            if key not in known:
                raise BagError(f"{scene.path}: nothing was recorded of {key}, which says what nuScenes calls a box")
        with foreign_content(f"{scene.path}: /world/legend"):
            self._blueprints = [str(each["name"]) for each in scene.constants["world/legend"]["blueprints"]]
        self._parked = {EGO_ID + k for k, each in enumerate(scene.spec.vehicles) if each.stands_at is not None}

    def of(self, frame: Frame, boxes: Table) -> tuple[list[str], list[list[str]]]:
        """Category, and attributes, at most one, of each of (N,) ``BOX_DTYPE`` boxes of a frame."""
        ridden = set(frame["world/actors"]["parent"].tolist())
        categories = categories_of(boxes, self._blueprints)
        return categories, attributes_of(boxes, categories, self._parked, ridden)
