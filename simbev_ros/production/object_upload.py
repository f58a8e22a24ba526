"""Uploads finished bags into an object store, from any machine that can reach it."""

from dataclasses import dataclass
from pathlib import Path

from simbev_ros.dataset.plan import PlannedEntry, bag_of
from simbev_ros.foundation.errors import UploadError
from simbev_ros.foundation.object_store.connection import StoreError
from simbev_ros.foundation.object_store.object_path import ObjectPath
from simbev_ros.foundation.object_store.transfers import delete_tree, put_file
from simbev_ros.recording.bag_files import disk_errors


@dataclass(frozen=True, slots=True)
class ObjectUploader:
    """Uploads finished bags to where the driver of a dataset finds them; it can be sent to other machines.

    Attributes:
        folder: Folder in the store that only one worker uses, laid out like a dataset.
    """

    folder: ObjectPath

    def upload(self, bag: Path, entry: PlannedEntry) -> None:
        """Upload a bag, large files in parts.

        Raises:
            UploadError: The store cannot be reached, refuses access, or fails.
            DiskError: The bag cannot be read.
        """
        target = bag_of(self.folder, entry)
        try:
            delete_tree(target)  # of an attempt that failed halfway
            with disk_errors(bag):
                for file in sorted(bag.iterdir()):
                    put_file(file, target / file.name)
        except StoreError as error:
            raise UploadError(f"{entry.name} was made, but could not be uploaded: {error}") from None
