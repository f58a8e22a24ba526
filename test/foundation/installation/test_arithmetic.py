"""NumPy and OpenBLAS round alike on processors with and without AVX-512."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from simbev_ros.foundation.installation.arithmetic import rounding_variables

LOADED = """
import ctypes, pathlib
import simbev_ros.cli  # as every command does before it loads NumPy
import numpy
from numpy._core._multiarray_umath import __cpu_features__ as features
print([name for name in ("X86_V4", "AVX512_ICL", "AVX512_SPR") if features[name]])
libraries = pathlib.Path(numpy.__file__).parents[1] / "numpy.libs"
core = ctypes.CDLL(str(next(libraries.glob("libscipy_openblas*")))).scipy_openblas_get_corename64_
core.restype = ctypes.c_char_p
print(core().decode())
"""


def has(*features: str) -> bool:
    flags = Path("/proc/cpuinfo").read_text("ascii").partition("flags")[2].partition("\n")[0].split()
    return set(features) <= set(flags)


@pytest.mark.skipif(not has("avx2", "fma"), reason="the processor lacks AVX2 or FMA")
def test_commands_use_what_all_processors_with_avx2_have() -> None:
    plain = {name: value for name, value in os.environ.items() if name not in rounding_variables({})}
    command = (sys.executable, "-W", "error", "-c", LOADED)
    done = subprocess.run(command, env=plain, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == ["[]", "Haswell"]


def test_the_users_own_values_are_kept(tmp_path: Path) -> None:
    cpuinfo = tmp_path / "cpuinfo"
    cpuinfo.write_text("processor : 0\nflags : fpu avx2 fma avx512f\n")
    assert sorted(rounding_variables({}, cpuinfo)) == ["NPY_DISABLE_CPU_FEATURES", "OPENBLAS_CORETYPE"]
    assert list(rounding_variables({"OPENBLAS_CORETYPE": "Zen"}, cpuinfo)) == ["NPY_DISABLE_CPU_FEATURES"]


@pytest.mark.parametrize("text", ["flags : fpu avx2\n", "Features : fp asimd\n", "\xff"])
def test_other_processors_are_left_alone(text: str, tmp_path: Path) -> None:
    cpuinfo = tmp_path / "cpuinfo"
    cpuinfo.write_text(text, encoding="latin-1")
    assert rounding_variables({}, cpuinfo) == {}
    assert rounding_variables({}, tmp_path / "none") == {}
