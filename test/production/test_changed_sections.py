"""Who goes on with another configuration is told which sections differ from those of the scenes that are there."""

from pathlib import Path

from simbev_ros.config.load import parse_scenario
from simbev_ros.production.dataset import changed_sections
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.layout import CONFIG_ATTACHMENT

CONFIG = """
seed: 7
scenes: [{map: Blocks, train: 1}]
rig: {sensors: [{type: gnss, name: gnss}]}
"""


def dataset(folder: Path, config: bytes) -> Path:
    with SceneBagWriter(folder / "scenes/train/Blocks-0000") as writer:
        writer.add_attachment(CONFIG_ATTACHMENT, "application/yaml", config)
        writer.finish({})
    return folder


def test_sections_that_change_the_content_of_scenes_are_named(tmp_path: Path) -> None:
    first = dataset(tmp_path, parse_scenario(CONFIG, "a.yaml").as_yaml().encode())
    for old, new, changed in (
        ("", "", []),
        ("train: 1", "train: 5, val: 2", []),
        ("seed: 7", "recording: {forms: [tables, messages]}\nseed: 7", []),
        ("seed: 7", "seed: 8", ["seed"]),
        ("{type: gnss, name: gnss}", "{type: imu, name: imu}", ["rig"]),
    ):
        assert changed_sections(parse_scenario(CONFIG.replace(old, new), "b.yaml"), first) == changed


def test_a_new_dataset_and_one_without_a_readable_configuration_are_like_any(tmp_path: Path) -> None:
    scenario = parse_scenario(CONFIG, "a.yaml")
    assert not changed_sections(scenario, tmp_path / "new")
    for number, config in enumerate((b"", b"[", b"seed: x", b"- 1", b"rig: 7\n")):
        assert not changed_sections(scenario, dataset(tmp_path / str(number), config))
