"""A dataset in an object store, as the driver of its production writes into it.

Workers record on local disks and upload each finished bag to ``.making/<run>/<worker>``. The driver copies it within
the store to its keys, adds its row to the index, which makes the scene exist, and deletes the uploaded objects. Killed
between any two of these steps, it leaves a scene that is there or is missing, never half of one.
"""

import secrets
import shutil
from collections import Counter
from collections.abc import Mapping

from simbev_ros.dataset.index_row import Row
from simbev_ros.dataset.plan import PlannedEntry, bag_of
from simbev_ros.dataset.staging import staging_of
from simbev_ros.dataset.stored_index import StoredIndex
from simbev_ros.foundation.object_store.connection import StoreError
from simbev_ros.foundation.object_store.object_lock import ObjectLock
from simbev_ros.foundation.object_store.object_path import ObjectPath
from simbev_ros.foundation.object_store.transfers import copy_object, delete_tree, list_objects
from simbev_ros.production.object_upload import ObjectUploader
from simbev_ros.production.scene_log import Attempt, write_scene_log
from simbev_ros.recording.bag_files import check_space
from simbev_ros.recording.layout import METADATA_FILE, SCENES_FOLDER, additional_bags
from simbev_ros.ros.graph.resources import temporary_folder


class BucketStorage:
    """Takes finished scenes that workers have uploaded; see ``DatasetStorage``.

    Args:
        path: The dataset.
        lock: Its lock, which the caller holds; it is checked before a scene is touched.
        min_free_bytes: Space on the disk for temporary files that must stay free.

    Attributes:
        index: The index.
        staging: Temporary folder for unfinished scenes of workers on this machine.
        damaged: Problems of scenes with other objects than the index describes, by name.

    Raises:
        InputError: The index is damaged, no temporary folder can be made, or the store cannot be reached or refuses
            access.
    """

    def __init__(self, path: ObjectPath, lock: ObjectLock, min_free_bytes: int) -> None:
        self._path, self._lock, self._min_free_bytes = path, lock, min_free_bytes
        self._uploads = staging_of(path) / secrets.token_hex(4)
        self.index = StoredIndex(path)
        self.damaged = _find_damage(path, self.index.sizes())
        self.staging = temporary_folder()

    @property
    def total_bytes(self) -> int:
        """Size of all scenes."""
        return self.index.total_bytes

    def uploader_for(self, worker: str) -> ObjectUploader:
        """Uploads a worker's bags to where ``commit`` finds them."""
        return ObjectUploader(self._uploads / worker)

    def commit(self, worker: str, entry: PlannedEntry, row: Row) -> None:
        """Copy a scene from a worker's uploads into the dataset, in place of an older one, and add it to the index.

        Raises:
            InputError: Another driver has taken over the dataset, or the store cannot be reached or refuses access.
        """
        uploaded, bag = bag_of(self._uploads / worker, entry), bag_of(self._path, entry)
        sizes = list_objects(uploaded)
        size = sum(size for path, size in sizes.items() if path.suffix == ".mcap")
        if size != row["bytes"]:
            raise StoreError(f"{uploaded}: {size:,} of {row['bytes']:,} bytes exist; the rest was deleted")
        self.remove(entry)
        for path in sorted(sizes, key=lambda path: (path.name == METADATA_FILE, path)):
            copy_object(path, bag / path.relative_to(uploaded))
        self.index.add(row)
        delete_tree(uploaded)
        self.damaged.pop(entry.name, None)

    def remove(self, entry: PlannedEntry) -> None:
        """Remove what is at the keys of a scene: an older one with its additional bags, or a copy that did not end.

        The row of an older scene is removed before its objects, so that no row describes other objects than there are.

        Raises:
            InputError: Another driver has taken over the dataset, or the store cannot be reached or refuses access.
        """
        self._lock.require()
        bag = bag_of(self._path, entry)
        if entry.number in self.index:
            for additional in additional_bags(bag).values():
                delete_tree(additional)
            self.index.remove(entry.number)
        delete_tree(bag)

    def log(self, attempt: Attempt, summary: str, output: Mapping[str, str], *, failed: bool = False) -> None:
        """Write the log of an attempt.

        Raises:
            StoreError: The store cannot be reached or refuses access.
        """
        write_scene_log(self._path, attempt, summary, output, failed=failed)

    def check_space(self, scenes: int) -> None:
        """Refuse to begin another scene that may not fit on the disk before it is uploaded.

        Raises:
            DiskError: Less is free than that many of the largest scene so far take plus what must stay free.
        """
        check_space(self.staging, self._min_free_bytes, self.index.largest_bytes * scenes)

    def discard(self, worker: str) -> None:
        """Remove what a worker that is lost has left here and in the store.

        Raises:
            StoreError: The store cannot be reached or refuses access.
        """
        shutil.rmtree(self.staging / worker, ignore_errors=True)
        delete_tree(self._uploads / worker)

    def close(self) -> None:
        """Write the index, and remove all unfinished scenes; those only, if another driver has taken over.

        Raises:
            StoreError: The store cannot be reached or refuses access.
        """
        shutil.rmtree(self.staging, ignore_errors=True)
        if self._lock.renew():
            self.index.write()
            delete_tree(staging_of(self._path))
        else:
            delete_tree(self._uploads)


def _find_damage(dataset: ObjectPath, sizes: Mapping[str, int]) -> dict[str, str]:
    """Problems of scenes by name: their MCAP files do not have the sizes in the index, given by path of the bag."""
    found: Counter[str] = Counter()
    for path, size in list_objects(dataset / SCENES_FOLDER).items() if sizes else ():
        if path.suffix == ".mcap":
            found[str(path.parent.relative_to(dataset))] += size
    return {
        bag.rpartition("/")[2]: f"its MCAP files have {found[bag]:,} bytes, and {size:,} according to the index"
        for bag, size in sizes.items()
        if found[bag] != size
    }
