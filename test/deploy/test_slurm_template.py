"""The Slurm template, run with commands in place of Slurm's and Ray's that write down how they were called."""

import os
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest
from waiting import PATIENCE_S

TEMPLATE = Path(__file__).parents[2] / "deploy/slurm/generate.sbatch"
NOTE = '#!/bin/bash\nprintf "%s\\n" "$(basename "$0")" "$@" "" >>"$CALLS"\n'
COMMANDS = {
    "slurm/scontrol": NOTE + "printf 'first\\nsecond\\nthird\\n'\n",
    "slurm/srun": NOTE + 'while [[ $1 == --* ]]; do shift; done\n"$@"\n',
    "slurm/hostname": "#!/bin/bash\necho '10.7.0.1 192.168.0.1 '\n",
    "home/.venv/bin/ray": NOTE + 'while [[ $1 != -- ]]; do shift; done\nshift\n${RAY_FAILS:+exit 0}\n"$@"\n',
    "home/simbev": NOTE + "exit ${SIMBEV_EXIT:-0}\n",
}


@dataclass
class Job:
    """How a job ended, and the calls of each command in the order in which they came."""

    exit_code: int
    errors: str
    calls: list[list[str]]

    def arguments(self, command: str) -> list[list[str]]:
        return [call[1:] for call in self.calls if call[0] == command]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, text in COMMANDS.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        path.chmod(0o755)
    return tmp_path


def run(folder: Path, *arguments: str, **variables: str) -> Job:
    calls = folder / "calls"
    environment = {
        "PATH": f"{folder / 'slurm'}:{os.environ['PATH']}",
        "SIMBEV_HOME": str(folder / "home"),
        "SLURM_JOB_NODELIST": "node[1-3]",
        "SLURM_JOB_NUM_NODES": "3",
        "CALLS": str(calls),
        "TMPDIR": str(folder),
        **variables,
    }
    done = subprocess.run(
        ["bash", str(TEMPLATE), *arguments],
        env=environment,
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    noted = calls.read_text().split("\n\n")[:-1] if calls.exists() else []
    return Job(done.returncode, done.stderr, [call.split("\n") for call in noted])


def test_every_node_starts_ray_once_with_the_address_of_the_first(folder: Path) -> None:
    job = run(folder, "my.yaml", "/shared/first")
    assert job.exit_code == 0, job.errors
    address, step = job.arguments("srun")
    assert "--nodelist=first" in address
    assert {"--nodes=3", "--ntasks-per-node=1"} <= set(step)
    (ray,) = job.arguments("ray")
    assert ray[:5] == ["symmetric-run", "--address", "10.7.0.1:6379", "--min-nodes", "3"]


def test_a_lost_node_does_not_end_the_step(folder: Path) -> None:
    _, step = run(folder, "my.yaml", "/shared/first").arguments("srun")
    assert {"--no-kill", "--kill-on-bad-exit=0", "--wait=0"} <= set(step)
    assert "#SBATCH --no-kill\n" in TEMPLATE.read_text()


def test_the_driver_gets_configuration_folder_and_all_further_options(folder: Path) -> None:
    job = run(folder, "my file.yaml", "/shared/first", "--retries", "1")
    expected = ["generate", "my file.yaml", "--out", "/shared/first", "--ray", "auto", "--retries", "1"]
    assert job.arguments("simbev") == [expected]


def test_the_job_ends_as_the_driver_ends(folder: Path) -> None:
    assert run(folder, "my.yaml", "/shared/first", SIMBEV_EXIT="3").exit_code == 3


def test_the_job_fails_when_ray_does_not_start(folder: Path) -> None:
    job = run(folder, "my.yaml", "/shared/first", RAY_FAILS="1")
    assert job.exit_code == 1
    assert job.errors == "simbev: Ray did not start; the lines above say why\n"


def test_a_job_without_folder_says_how_it_is_used(folder: Path) -> None:
    job = run(folder, "my.yaml")
    assert job.exit_code != 0
    assert "usage: sbatch generate.sbatch CONFIG OUT" in job.errors
    assert job.calls == []


def test_nothing_is_left_in_the_folder_for_temporary_files(folder: Path) -> None:
    before = {path.name for path in folder.iterdir()}
    run(folder, "my.yaml", "/shared/first")
    assert {path.name for path in folder.iterdir()} == before | {"calls"}
