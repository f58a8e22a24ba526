"""The image is built for real, from a bare Debian, and records a scene without root and without a GPU."""

import json
import os
import shutil
from collections.abc import Iterator

import pytest
from container_store import ContainerStore

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(os.geteuid() != 0, reason="only root can build without a daemon"),
    pytest.mark.skipif(shutil.which("debootstrap") is None, reason="debootstrap is not installed"),
    pytest.mark.skipif(shutil.which("buildah") is None, reason="buildah is not installed"),
]


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ContainerStore]:
    store = ContainerStore(tmp_path_factory.mktemp("containers") / "store")
    yield store
    store.remove()


@pytest.fixture(scope="module")
def image(store: ContainerStore) -> str:
    return store.build("simbev", {"BASE": store.bootstrap_base("trixie")})


def test_an_unprivileged_user_records_the_demo(store: ContainerStore, image: str) -> None:
    ran = store.run(image, "sh", "-c", "id -u && simbev demo && stat -c %s out/demo/Blocks-0000.png")
    assert ran.returncode == 0, ran.stdout + ran.stderr
    lines = ran.stdout.split("\n")
    assert lines[0] == "1000"
    assert int(lines[-2]) > 100_000


def test_any_other_user_can_run_the_image_too(store: ContainerStore, image: str) -> None:
    ran = store.run(image, "simbev", "doctor", user="4321")
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert "✗" not in ran.stdout


def test_it_holds_a_bill_of_materials(store: ContainerStore, image: str) -> None:
    ran = store.run(image, "cat", "/usr/local/share/sbom/simbev.cdx.json")
    assert len(json.loads(ran.stdout)["components"]) > 150


def test_the_doctor_names_the_option_when_shared_memory_is_what_containers_have_by_default(
    store: ContainerStore, image: str
) -> None:
    assert "--shm-size" in store.run(image, "simbev", "doctor", shared_memory="64m").stdout


def test_its_user_cannot_change_what_is_installed(store: ContainerStore, image: str) -> None:
    ran = store.run(image, "touch", "/opt/simbev/new", "/opt/simbev/.venv/new")
    assert ran.returncode != 0
    assert ran.stderr.count("Permission denied") == 2
