"""libsumo without its note on standard output, which is for results.

It warns of any pyarrow but the one that it was built with; that matters to outputs in Parquet alone.
"""

from contextlib import redirect_stdout
from io import StringIO

with redirect_stdout(StringIO()):
    import libsumo

__all__ = ["libsumo"]
