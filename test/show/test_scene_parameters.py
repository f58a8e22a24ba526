"""Tables of what was drawn for a scene."""

from made_up_scene import SENSORS, made_up_spec
from several_agents import made_up_agents

from simbev_ros.show.pages.scene_parameters import parameter_section


def test_several_agents_are_listed() -> None:
    row = '<th scope="row">agents</th>'
    assert f"{row}<td>ego, car, rsu</td>" in parameter_section(made_up_agents())
    assert row not in parameter_section(made_up_spec(SENSORS))
