"""Imports of ``tools`` find the repository's top folder, because the tools are not installed."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))
