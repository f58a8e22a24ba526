"""Makes libraries round alike on every x86-64 processor with AVX2, so that bytes do not depend on the processor.

NumPy and OpenBLAS take other instructions, and round differently in the last bit, where there is AVX-512. They read
these variables when they are loaded. This module imports nothing but the standard library.
"""

from collections.abc import Mapping
from pathlib import Path

_NEEDED = {"avx2", "fma"}
_VARIABLES = {
    "OPENBLAS_CORETYPE": "Haswell",
    "NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR",
}


def rounding_variables(environment: Mapping[str, str], cpuinfo: Path = Path("/proc/cpuinfo")) -> dict[str, str]:
    """Variables with which a process rounds as on other processors, to set before it loads NumPy.

    Args:
        environment: Such as ``os.environ``; what it sets already is not among the result.
        cpuinfo: What Linux says about the processor.

    Returns:
        Nothing on a processor that lacks what the variables ask for.
    """
    try:
        flags = next(line for line in cpuinfo.read_text(encoding="ascii").splitlines() if line.startswith("flags"))
    except (OSError, StopIteration, UnicodeDecodeError):
        return {}
    if not set(flags.split()) >= _NEEDED:
        return {}
    return {name: value for name, value in _VARIABLES.items() if name not in environment}
