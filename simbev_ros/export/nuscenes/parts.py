"""An export in parts, one a scene. Each is made beside the rest and moved in when it is whole.

So what an end at any moment, a power cut too, leaves under its final name is whole, and the next run goes on from
there. What a part
says to the tables of the whole is kept next to it until they are written, and for runs that add scenes.
"""

import json
import shutil
from collections.abc import Mapping
from glob import escape
from pathlib import Path
from typing import Any

from simbev_ros import __version__
from simbev_ros.dataset import Scene
from simbev_ros.recording.layout import PARTIAL_SUFFIX, bytes_of, mcap_files
from simbev_ros.recording.mcap.syncing import sync, sync_names

_FOLDER = ".parts"

Json = dict[str, Any]


class Parts:
    """The parts of the export in one folder.

    Attributes:
        out: The folder.
        settings: All that a part depends on beside its scene; plain values.
    """

    def __init__(self, out: Path, settings: Mapping[str, Any]) -> None:
        self.out, self.settings = out, dict(settings)
        self._folder = out / _FOLDER

    @property
    def are_begun(self) -> bool:
        """Whether what is in the folder is an export of ours."""
        return self._folder.is_dir()

    def is_done(self, scene: Scene) -> bool:
        """Whether there is a part of the scene as it is now, with these settings."""
        return self._known(scene).get("made_from") == self._made_from(scene)

    def begin(self, scene: Scene) -> Path:
        """An empty folder to make a part in; files of an earlier part of this scene are gone."""
        staging = self._staging(scene)
        if staging.exists() or self._head(scene).exists():
            staging.mkdir(exist_ok=True)  # should this be as far as we come, the next run knows to go on here
            self._head(scene).unlink(missing_ok=True)
            for file in self.out.glob(f"*/*/{escape(scene.name)}__*"):
                file.unlink()
            shutil.rmtree(staging)
        staging.mkdir(parents=True)
        return staging

    def move_in(self, scene: Scene, summary: Json, content: Json) -> None:
        """Give the files in the part's folder their places.

        Args:
            scene: The scene.
            summary: What is to be read quickly.
            content: What is to be read once.
        """
        staging = self._staging(scene)
        places = {path: self.out / path.relative_to(staging) for path in staging.rglob("*") if path.is_file()}
        sync(*places)
        for file, place in places.items():
            place.parent.mkdir(parents=True, exist_ok=True)
            file.replace(place)
        sync_names([*places.values(), *(place.parent for place in places.values())])
        head = {"made_from": self._made_from(scene), "summary": summary}
        for value, place in (content, self._content(scene)), (head, self._head(scene)):
            unfinished = staging / place.name
            unfinished.write_text(json.dumps(value), encoding="utf-8")
            sync(unfinished)
            unfinished.replace(place)
            sync_names([place])
        shutil.rmtree(staging)

    def tidy(self) -> None:
        """Remove what ends of earlier runs have left; when all parts are made."""
        for staging in self._folder.glob(f"*{PARTIAL_SUFFIX}"):
            shutil.rmtree(staging)

    def summary(self, scene: Scene) -> Json:
        """That of a scene's part, which is done."""
        summary: Json = self._known(scene)["summary"]
        return summary

    def content(self, scene: Scene) -> Json:
        """That of a scene's part, which is done."""
        content: Json = json.loads(self._content(scene).read_text(encoding="utf-8"))
        return content

    def _made_from(self, scene: Scene) -> Json:
        newest_ns = max(file.stat().st_mtime_ns for file in mcap_files(scene.path))
        return {"bytes": bytes_of(scene.path), "mtime_ns": newest_ns, "by": __version__, **self.settings}

    def _known(self, scene: Scene) -> Json:
        path = self._head(scene)
        known: Json = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
        return known

    def _staging(self, scene: Scene) -> Path:
        return self._folder / f"{scene.name}{PARTIAL_SUFFIX}"

    def _head(self, scene: Scene) -> Path:
        return self._folder / f"{scene.name}.head.json"

    def _content(self, scene: Scene) -> Path:
        return self._folder / f"{scene.name}.json"
