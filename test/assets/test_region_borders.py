"""Roads whose edge is the border of a region, as where a file's reference line runs along y = 0."""

from pathlib import Path

import pytest

from simbev_ros.assets.regions.build import build_region
from simbev_ros.maps.build import load_network
from simbev_ros.maps.land.terrain import Terrain
from simbev_ros.maps.region import regions_of
from simbev_ros.maps.source import map_spec

ROAD = """<road id="{number}" length="{length_m}" junction="-1"><link/><planView>
<geometry s="0" x="0" y="{y_m}" hdg="0" length="{length_m}"><line/></geometry></planView>
<lanes><laneSection s="0"><left>{left}</left><center><lane id="0" type="none"/></center><right>{right}</right>
</laneSection></lanes></road>"""
LANE = '<lane id="{}" type="{}"><width sOffset="0" a="3" b="0" c="0" d="0"/></lane>'
LEFT = LANE.format(1, "driving") + LANE.format(2, "sidewalk")
RIGHT = LANE.format(-1, "driving") + LANE.format(-2, "sidewalk")


@pytest.mark.parametrize("left", ["", LEFT])
def test_regions_that_a_road_only_touches_are_built(tmp_path: Path, left: str) -> None:
    path = tmp_path / "edge.xodr"
    near = ROAD.format(number=1, length_m=100, y_m=0, left=left, right=RIGHT)
    far = ROAD.format(number=2, length_m=300, y_m=500, left="", right=RIGHT)
    path.write_text(f"<OpenDRIVE>{near}{far}</OpenDRIVE>")
    network = load_network(map_spec(str(path)), tmp_path)
    terrain = Terrain(network)
    regions = regions_of(network.layout)
    assert len(regions) >= 4
    for region in regions:
        assert build_region(network, region, terrain).tiles
