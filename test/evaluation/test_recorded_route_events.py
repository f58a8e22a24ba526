"""Events of a recorded drive that belong to its route."""

from types import SimpleNamespace

from simbev_ros.evaluation.driving.recorded_drives import _route_events


def test_collisions_and_commands_to_entities_are_no_events_of_the_route() -> None:
    kinds = ["collision", "entity.spawn", "cut_in.begin", "entity.delete", "cut_in.end"]
    scene = SimpleNamespace(records=lambda name: [{"type": kind} for kind in kinds if name == "world/events"])
    assert [each["type"] for each in _route_events(scene)] == ["cut_in.begin", "cut_in.end"]  # type: ignore[arg-type]
