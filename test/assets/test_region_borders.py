"""Roads whose edge is the border of a region, as where a file's reference line runs along y = 0."""

from pathlib import Path

import pytest

from simbev_ros.assets.build import build_region
from simbev_ros.maps.build import load_network
from simbev_ros.maps.region import regions_of
from simbev_ros.maps.source import map_spec
from simbev_ros.maps.terrain import Terrain

ROAD = """<OpenDRIVE><road id="1" length="100" junction="-1"><link/><planView>
<geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry></planView><lanes><laneSection s="0"><left>{left}</left>
<center><lane id="0" type="none"/></center><right>{right}</right></laneSection></lanes></road>
<road id="2" length="50" junction="-1"><link/><planView><geometry s="0" x="0" y="60" hdg="0" length="50"><line/></geometry>
</planView><lanes><laneSection s="0"><center><lane id="0" type="none"/></center><right>{right}</right></laneSection></lanes>
</road></OpenDRIVE>"""
LANES = '<lane id="{0}1" type="driving"><width a="3.5"/></lane><lane id="{0}2" type="sidewalk"><width a="2"/></lane>'


@pytest.mark.parametrize("sides", [("", LANES.format("-")), (LANES.format(""), LANES.format("-"))])
def test_regions_that_a_road_only_touches_are_built(tmp_path: Path, sides: tuple[str, str]) -> None:
    path = tmp_path / "edge.xodr"
    path.write_text(ROAD.format(left=sides[0], right=sides[1]))
    network = load_network(map_spec(str(path)), tmp_path)
    terrain = Terrain(network)
    regions = regions_of(network.layout)
    assert len(regions) == 4
    for region in regions:
        assert build_region(network, region, terrain).tiles
