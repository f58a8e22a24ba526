"""Container images, built and run by buildah in a folder, as root and without a daemon or a registry."""

import os
import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path

from bare_root import CERTIFICATE_VARIABLES, CERTIFICATES, REPOSITORY, bootstrap, host_certificates, pip_settings

CONFIGURATION = '[storage]\ndriver = "vfs"\nrunroot = "{folder}/run"\ngraphroot = "{folder}/images"\n'
ENTER = """
set -e
mount -t proc proc /proc
mount -t tmpfs -o size="$1" tmpfs /dev/shm
chmod 1777 /dev/shm
shift
exec "$@"
"""


class ContainerStore:
    """Images and containers in a folder; each container has processes, mounts and /dev/shm of its own."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        folder.mkdir(parents=True)
        configuration = folder / "storage.conf"
        configuration.write_text(CONFIGURATION.format(folder=folder))
        self._environment = os.environ | {
            "CONTAINERS_STORAGE_CONF": str(configuration),
            "STORAGE_DRIVER": "vfs",
            "BUILDAH_ISOLATION": "chroot",
        }

    def bootstrap_base(self, suite: str) -> str:
        """Make an image of a bare Debian with the host's settings of pip, and return its name."""
        root = self._folder / suite
        bootstrap(root, suite)
        settings = pip_settings()
        if certificates := host_certificates():
            shutil.copy(certificates, root / CERTIFICATES)
            settings |= dict.fromkeys(CERTIFICATE_VARIABLES, f"/{CERTIFICATES}")
        container = self._buildah("from", "scratch")
        self._buildah("add", "--quiet", container, str(root), "/")
        options = [f"--env={name}={value}" for name, value in settings.items()]
        self._buildah("config", *options, container)
        self._buildah("commit", "--quiet", "--rm", container, f"localhost/{suite}")
        shutil.rmtree(root)
        return f"localhost/{suite}"

    def build(self, name: str, arguments: Mapping[str, str]) -> str:
        """Build the Dockerfile of the repository with build arguments, and return the image's name."""
        options = [f"--build-arg={key}={value}" for key, value in arguments.items()]
        self._buildah("build", "--format=docker", *options, f"--tag=localhost/{name}", str(REPOSITORY))
        return f"localhost/{name}"

    def run(
        self, image: str, *command: str, shared_memory: str = "1g", user: str | None = None
    ) -> "subprocess.CompletedProcess[str]":
        """Run a command in a new container; its mounts and processes end with it."""
        container = self._buildah("from", image)
        options = ["--user", user] if user else []
        unshare = ["unshare", "--mount", "--pid", "--fork", "--kill-child", "sh", "-c", ENTER, "sh", shared_memory]
        try:
            return subprocess.run(
                [*unshare, "buildah", "run", *options, container, "--", *command],
                env=self._environment,
                capture_output=True,
                text=True,
                errors="replace",
                timeout=900,
                check=False,
            )
        finally:
            self._buildah("rm", container)

    def remove(self) -> None:
        """Delete the folder with all images."""
        shutil.rmtree(self._folder)

    def _buildah(self, *arguments: str) -> str:
        """The last line that buildah prints: the name of what it made."""
        done = subprocess.run(
            ["buildah", *arguments], env=self._environment, capture_output=True, text=True, timeout=1800, check=False
        )
        assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
        return done.stdout.strip().rpartition("\n")[2]
