"""Import libsumo without its message on standard output, which is reserved for results.

libsumo warns about any pyarrow version other than the one it was built with; this only matters for Parquet output.
"""

from contextlib import redirect_stdout
from io import StringIO

with redirect_stdout(StringIO()):
    import libsumo

__all__ = ["FAILURES", "libsumo"]

FAILURES = (libsumo.TraCIException, libsumo.FatalTraCIError)
"""Exceptions with which SUMO fails."""
