"""A bare Debian or Ubuntu in a folder, as debootstrap makes it, in which commands run as on a new machine."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

REPOSITORY = Path(__file__).parents[2]
NOT_COPIED = shutil.ignore_patterns(".venv*", ".git", ".setup*", ".*_cache", "build", "out", "datasets", "__pycache__")
UBUNTU_SCRIPT = "gutsy"
"""debootstrap's script for every Ubuntu since; older debootstraps have no link to it for new releases."""
CERTIFICATES = "etc/host-certificates.pem"
CERTIFICATE_VARIABLES = ("SSL_CERT_FILE", "PIP_CERT", "REQUESTS_CA_BUNDLE", "CURL_CA_BUNDLE")
LOOPBACK_UP = (
    "import fcntl, socket, struct; "
    "fcntl.ioctl(socket.socket(socket.AF_INET, socket.SOCK_DGRAM), 0x8914, struct.pack('16sh14x', b'lo', 0x41))"
)
ENTER = """
set -e
mount --rbind /dev "$1/dev"
mount -t tmpfs tmpfs "$1/dev/shm"
mount -t proc proc "$1/proc"
mount -t sysfs sysfs "$1/sys"
exec chroot "$1" sh -c "$2"
"""


class BareRoot:
    """A root folder with the checkout in /root/simbev_ros and the host's settings of pip."""

    def __init__(self, folder: Path, suite: str, *, ubuntu: bool = False) -> None:
        """Make the root.

        Raises:
            subprocess.CalledProcessError: debootstrap failed, as where no mirror answers.
        """
        self.folder = folder
        bootstrap(folder, suite, ubuntu=ubuntu)
        shutil.copytree(REPOSITORY, folder / "root" / "simbev_ros", ignore=NOT_COPIED)
        self._copy_host_settings()

    def _copy_host_settings(self) -> None:
        """Copy what name servers and certificates this host uses."""
        shutil.copy("/etc/resolv.conf", self.folder / "etc")
        if certificates := host_certificates():
            shutil.copy(certificates, self.folder / CERTIFICATES)

    def environment(self) -> dict[str, str]:
        """Return a clean environment with the host's proxies, certificates and settings of pip."""
        passed = {name: value for name, value in os.environ.items() if name.lower().endswith("_proxy")}
        passed |= pip_settings()
        if (self.folder / CERTIFICATES).is_file():
            passed |= dict.fromkeys(CERTIFICATE_VARIABLES, f"/{CERTIFICATES}")
        return {"HOME": "/root", "PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "TERM": "dumb", **passed}

    def run(
        self, command: str, *, offline: bool = False, timeout_s: float = 1800
    ) -> "subprocess.CompletedProcess[str]":
        """Run a shell command in the checkout; its mounts and processes end with it."""
        unshare = ["unshare", "--mount", "--pid", "--fork", "--kill-child", *(["--net"] if offline else [])]
        enter = [*unshare, "sh", "-c", ENTER, "sh", str(self.folder), f"cd /root/simbev_ros && {command}"]
        if offline:
            loopback = f'"{sys.executable}" -c "{LOOPBACK_UP}"'
            enter = [*unshare, "sh", "-c", f"{loopback}\n{ENTER}", *enter[-3:]]
        environment = self.environment()
        return subprocess.run(
            enter, env=environment, capture_output=True, text=True, errors="replace", timeout=1800, check=False
        )

    def remove(self) -> None:
        """Delete the folder."""
        shutil.rmtree(self.folder)


def bootstrap(folder: Path, suite: str, *, ubuntu: bool = False) -> None:
    """Install the smallest Debian or Ubuntu of a suite into a folder.

    Raises:
        subprocess.CalledProcessError: debootstrap failed, as where no mirror answers.
    """
    options = ["--variant=minbase"]
    more = []
    if ubuntu:
        more = ["", UBUNTU_SCRIPT]  # the empty one: the mirror that debootstrap knows
        options += ["--components=main,universe"]
        if not Path("/usr/share/keyrings/ubuntu-archive-keyring.gpg").exists():
            options += ["--no-check-gpg"]  # Debian has no package of Ubuntu's keys
    command = ["debootstrap", *options, suite, str(folder), *more]
    subprocess.run(command, check=True, capture_output=True, text=True, timeout=900)


def host_certificates() -> str | None:
    """Return the file of certificates that this host's settings name."""
    return next((os.environ[name] for name in CERTIFICATE_VARIABLES if name in os.environ), None)


def pip_settings() -> dict[str, str]:
    """Return pip's settings on this host as variables, without those that name this host's own files."""
    command = [sys.executable, "-m", "pip", "config", "list"]
    listed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    found = (line.partition("=") for line in listed.splitlines())
    settings = {name.rpartition(".")[2]: value.strip("'") for name, _, value in found}
    return {
        f"PIP_{name.upper().replace('-', '_')}": value
        for name, value in settings.items()
        if not value.startswith("/") and "file:" not in value
    }
