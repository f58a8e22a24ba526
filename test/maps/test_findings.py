"""Findings are distinguished by position, counted beyond a limit, and summed up in one sentence for each rule."""

from pathlib import Path

import numpy as np
import pytest

from simbev_ros.maps import findings
from simbev_ros.maps.findings import Finding, Findings, Outcome, sentences_of
from simbev_ros.maps.safe_xml import parse


def test_a_sentence_names_the_first_place_the_number_and_the_loss() -> None:
    found = [
        Finding("an edge without lanes is left out", line=7, detail="A", lost_m=120.0),
        Finding("it has no projection", Outcome.ASSUMED),
        Finding("an edge without lanes is left out", line=9, detail="B", count=2, lost_m=80.0),
    ]
    assert sentences_of("a.net.xml", found) == (
        "a.net.xml:7: an edge without lanes is left out (A; 3 times; 0.20 km of lanes)",
        "it has no projection",
    )


def test_a_finding_has_the_line_of_its_element(tmp_path: Path) -> None:
    path = tmp_path / "a.xodr"
    path.write_text("<OpenDRIVE>\n\n<road/></OpenDRIVE>")
    collected = Findings(path)
    collected.left_out("a road is left out", parse(path, "OpenDRIVE")[0], "road 1", np.array([3.0, 4.0]), 50.0)
    (finding,) = collected.all()
    assert (finding.line, finding.outcome, finding.lost_m) == (3, Outcome.LEFT_OUT, 50.0)
    collected.transform(lambda points_m: points_m + np.array([10.0, 0.0, 0.0]))
    assert collected.all()[0].position_m.tolist() == [13.0, 4.0]


def test_places_beyond_the_limit_are_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(findings, "MAX_FINDINGS", 3)
    collected = Findings(tmp_path / "a.osm")
    for _ in range(10):
        collected.repaired("a way is shortened")
        collected.assumed("another kind")
    found = collected.all()
    assert [finding.count for finding in found if finding.rule == "a way is shortened"] == [1, 1, 8]
    assert len(found) == 6
