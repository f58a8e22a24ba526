"""Runs commands in tests, with their output in the error message if they fail."""

import os
import subprocess


def run(*words: object, environment: dict[str, str] | None = None, timeout_s: float = 600) -> str:
    done = subprocess.run(
        [str(word) for word in words],
        env={**os.environ, **(environment or {})},
        capture_output=True,
        text=True,
        timeout=timeout_s,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout
