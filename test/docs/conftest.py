"""The tools of the repository are no package that is installed: they are imported from its top."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))
