"""The templates for Kubernetes and for Ray's cluster launcher have only fields that their readers know, and agree."""

import copy
import json
import re
import shlex
from importlib import util
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml

ROOT = Path(__file__).parents[2]
RAYJOB = yaml.safe_load((ROOT / "deploy/kubernetes/rayjob.yaml").read_text())
RAYJOB_SCHEMA = json.loads((ROOT / "test/deploy/rayjob.schema.json").read_text())
LAUNCHER = yaml.safe_load((ROOT / "deploy/aws/cluster.yaml").read_text())
SLURM = (ROOT / "deploy/slurm/generate.sbatch").read_text()
CLUSTER = RAYJOB["spec"]["rayClusterSpec"]
GROUPS = [CLUSTER["headGroupSpec"], *CLUSTER["workerGroupSpecs"]]
IDS = ["head", *(group["groupName"] for group in CLUSTER["workerGroupSpecs"])]
KUBERNETES = "1.33"
GIB = 2**30


def pod(group: dict[str, Any]) -> dict[str, Any]:
    """A pod as the group's template describes it."""
    return {"apiVersion": "v1", "kind": "Pod", "metadata": {"name": "any"}, **group["template"]}


def validate_launcher(configuration: dict[str, Any]) -> None:
    ray = util.find_spec("ray")
    if ray is None or ray.origin is None:
        pytest.skip("ray is not installed")
    schema = json.loads((Path(ray.origin).parent / "autoscaler/ray-schema.json").read_text())
    jsonschema.validate(configuration, schema)


def test_the_rayjob_has_only_documented_fields() -> None:
    jsonschema.validate(RAYJOB, RAYJOB_SCHEMA)


def test_an_unknown_field_of_a_rayjob_is_found() -> None:
    wrong = copy.deepcopy(RAYJOB)
    wrong["spec"]["rayClusterSpec"]["workerGroupSpecs"][0]["maxReplica"] = 3
    with pytest.raises(jsonschema.ValidationError, match="maxReplica"):
        jsonschema.validate(wrong, RAYJOB_SCHEMA)


@pytest.mark.slow
@pytest.mark.parametrize("group", GROUPS, ids=IDS)
def test_pods_keep_the_schema_of_kubernetes(group: dict[str, Any]) -> None:
    pytest.importorskip("kubernetes_validate").validate(pod(group), KUBERNETES, strict=True)


@pytest.mark.parametrize("group", GROUPS, ids=IDS)
def test_pods_run_as_the_user_of_the_image_and_gain_no_privileges(group: dict[str, Any]) -> None:
    spec = group["template"]["spec"]
    (container,) = spec["containers"]
    uid = re.search(r"^ARG UID=(\d+)$", (ROOT / "Dockerfile").read_text(), re.MULTILINE)
    assert uid is not None
    assert spec["securityContext"]["runAsNonRoot"] and spec["securityContext"]["runAsUser"] == int(uid[1])
    assert container["securityContext"] == {"allowPrivilegeEscalation": False, "capabilities": {"drop": ["ALL"]}}


@pytest.mark.parametrize("group", GROUPS, ids=IDS)
def test_every_volume_that_is_mounted_is_there(group: dict[str, Any]) -> None:
    spec = group["template"]["spec"]
    assert {mount["name"] for mount in spec["containers"][0]["volumeMounts"]} == {
        each["name"] for each in spec["volumes"]
    }


def test_shared_memory_of_workers_holds_several_graphs_and_what_ray_stores() -> None:
    (group,) = CLUSTER["workerGroupSpecs"]
    (volume,) = group["template"]["spec"]["volumes"]
    in_kubernetes = int(volume["emptyDir"]["sizeLimit"].removesuffix("Gi")) * GIB
    option = next(each for each in LAUNCHER["docker"]["run_options"] if each.startswith("--shm-size="))
    assert in_kubernetes == int(option.removeprefix("--shm-size=").removesuffix("g")) * GIB
    assert in_kubernetes > 2 * GIB + int(group["rayStartParams"]["object-store-memory"])


def test_the_launcher_has_only_fields_that_ray_knows() -> None:
    validate_launcher(LAUNCHER)


def test_an_unknown_field_of_the_launcher_is_found() -> None:
    with pytest.raises(jsonschema.ValidationError, match="max_worker"):
        validate_launcher({**LAUNCHER, "max_worker": 3})


def test_only_workers_are_spot_nodes_and_only_they_make_scenes() -> None:
    types = dict(LAUNCHER["available_node_types"])
    head = types.pop(LAUNCHER["head_node_type"])
    assert head["resources"]["CPU"] == 0 and "InstanceMarketOptions" not in head["node_config"]
    assert all(each["node_config"]["InstanceMarketOptions"] == {"MarketType": "spot"} for each in types.values())
    assert CLUSTER["headGroupSpec"]["rayStartParams"]["num-cpus"] == "0"


def test_all_templates_start_one_image_with_the_same_store_of_objects() -> None:
    images = {group["template"]["spec"]["containers"][0]["image"] for group in GROUPS} | {LAUNCHER["docker"]["image"]}
    version = re.search(r"<version>(.*?)</version>", (ROOT / "package.xml").read_text())
    assert version is not None
    assert images == {f"registry.example.com/simbev:{version[1]}"}
    commands = " ".join([*LAUNCHER["head_start_ray_commands"], *LAUNCHER["worker_start_ray_commands"], SLURM])
    sizes = {*re.findall(r"--object-store-memory[= ](\d+)", commands)}
    assert sizes == {group["rayStartParams"]["object-store-memory"] for group in GROUPS}


def test_the_entrypoint_reads_the_configuration_that_is_mounted_in_the_head() -> None:
    words = shlex.split(RAYJOB["spec"]["entrypoint"])
    mounts = {mount["mountPath"] for mount in GROUPS[0]["template"]["spec"]["containers"][0]["volumeMounts"]}
    assert words[:2] == ["simbev", "generate"] and str(Path(words[2]).parent) in mounts
    assert words[-2:] == ["--ray", "auto"]


def test_the_container_that_the_launcher_starts_runs_a_shell_instead_of_simbev() -> None:
    assert "--entrypoint=/usr/bin/env" in LAUNCHER["docker"]["run_options"]


def test_all_templates_give_ray_a_token() -> None:
    assert CLUSTER["authOptions"] == {"mode": "token"}
    assert "--env=RAY_AUTH_MODE=token" in LAUNCHER["docker"]["run_options"]
    assert LAUNCHER["file_mounts"] == {"~/.ray/auth_token": "~/.ray/auth_token"}
    assert "export RAY_AUTH_MODE=token RAY_AUTH_TOKEN\n" in SLURM
