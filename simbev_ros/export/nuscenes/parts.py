"""Keeps an export in parts, one for each scene, so that an interrupted export can resume.

A part is made in a staging folder and moved to its final paths when it is complete. Whatever ends a run, even a power
cut, all files at their final paths are complete, and the next run continues from there. The rows that a part
contributes to the tables of the export are kept beside it until the tables are written, and for runs that add scenes.
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
        settings: Settings on which a part depends besides its scene; plain values.
    """

    def __init__(self, out: Path, settings: Mapping[str, Any]) -> None:
        self.out, self.settings = out, dict(settings)
        self._folder = out / _FOLDER

    @property
    def is_begun(self) -> bool:
        """Whether the folder contains an export of ours."""
        return self._folder.is_dir()

    def is_done(self, scene: Scene) -> bool:
        """Whether there is a finished part of the scene in its present state, with these settings."""
        return self._known(scene).get("made_from") == self._made_from(scene)

    def begin(self, scene: Scene) -> Path:
        """Remove an earlier part of the scene, and make an empty staging folder for a new one."""
        staging = self._staging(scene)
        if staging.exists() or self._head(scene).exists():
            staging.mkdir(exist_ok=True)  # if the run ends here, the next one continues the removal
            self._head(scene).unlink(missing_ok=True)
            for file in self.out.glob(f"*/*/{escape(scene.name)}__*"):
                file.unlink()
            shutil.rmtree(staging)
        staging.mkdir(parents=True)
        return staging

    def finish(self, scene: Scene, summary: Json, content: Json) -> None:
        """Move the files of a part from its staging folder to their final paths, then record it as finished.

        Args:
            scene: The scene.
            summary: Small facts that are read whenever the export is continued.
            content: Large facts that are read only when the tables are written.
        """
        staging = self._staging(scene)
        targets = {path: self.out / path.relative_to(staging) for path in staging.rglob("*") if path.is_file()}
        sync(*targets)
        for file, target in targets.items():
            target.parent.mkdir(parents=True, exist_ok=True)
            file.replace(target)
        sync_names([*targets.values(), *(target.parent for target in targets.values())])
        head = {"made_from": self._made_from(scene), "summary": summary}
        for value, target in (content, self._content(scene)), (head, self._head(scene)):
            unfinished = staging / target.name
            unfinished.write_text(json.dumps(value), encoding="utf-8")
            sync(unfinished)
            unfinished.replace(target)
            sync_names([target])
        shutil.rmtree(staging)

    def tidy(self) -> None:
        """Remove the staging folders of interrupted runs, once all parts are made."""
        for staging in self._folder.glob(f"*{PARTIAL_SUFFIX}"):
            shutil.rmtree(staging)

    def summary(self, scene: Scene) -> Json:
        """Summary of a scene's finished part."""
        summary: Json = self._known(scene)["summary"]
        return summary

    def content(self, scene: Scene) -> Json:
        """Content of a scene's finished part."""
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
