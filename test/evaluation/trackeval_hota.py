"""Evaluates tracks with TrackEval. Run by its own Python, without this project: SCENES MIN_SCORE → JSON on stdout."""

import contextlib
import io
import json
import sys
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
from trackeval.datasets._base_dataset import _BaseDataset  # type: ignore[import-not-found]
from trackeval.metrics import HOTA  # type: ignore[import-not-found]

NAMES = ("HOTA", "DetA", "AssA", "AssPr", "AssRe")


def sequence(scene: dict[str, Any], name: str, min_score: float) -> dict[str, Any]:
    """Data of a scene and class, in the form of TrackEval's datasets."""
    scores = defaultdict(list)
    for row in scene["predictions"]:
        scores[row[2]].append(row[5])
    truth = [row for row in scene["truth"] if row[0] == name]
    found = [row for row in scene["predictions"] if row[0] == name and np.mean(scores[row[2]]) >= min_score]
    ids, boxes = {}, {}
    for kind, rows in (("gt", truth), ("tracker", found)):
        number = {track: index for index, track in enumerate(sorted({row[2] for row in rows}))}
        frames = [[row for row in rows if row[1] == frame] for frame in range(scene["frames"])]
        ids[kind] = [np.array([number[row[2]] for row in frame], int) for frame in frames]
        boxes[kind] = [np.array([row[3:5] for row in frame], float).reshape(-1, 2) for frame in frames]
    similarity = _BaseDataset._calculate_euclidean_similarity
    return {
        **{f"{kind}_ids": each for kind, each in ids.items()},
        **{f"num_{kind}_dets": sum(map(len, each)) for kind, each in ids.items()},
        **{f"num_{kind}_ids": len(np.unique(np.concatenate(each))) for kind, each in ids.items()},
        "similarity_scores": [similarity(*each) for each in zip(boxes["gt"], boxes["tracker"], strict=True)],
    }


def main(path: str, min_score: str) -> None:
    """Print the metrics by class."""
    scenes, metric = json.loads(Path(path).read_text()), HOTA()
    results = {}
    for name in sorted({row[0] for scene in scenes for row in scene["truth"]}):
        with contextlib.redirect_stdout(io.StringIO()):
            data = [sequence(scene, name, float(min_score)) for scene in scenes]
            parts = {str(number): metric.eval_sequence(each) for number, each in enumerate(data)}
            combined = metric.combine_sequences(parts)
        results[name] = {each: float(np.mean(combined[each])) for each in NAMES}
    print(json.dumps(results))


main(*sys.argv[1:])
