"""docs/reference/limits-of-input.md: the limits of foreign input, from constants of ``foundation.files.limits``.

The text after a constant is its description, so values and page cannot differ.
"""

import ast
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

from simbev_ros.foundation.files import limits
from tools.docs.markdown import GENERATED, code, sentence, table

_INTRODUCTION = f"""# Limits of input

Bags, datasets, maps and predictions are passed around, and a small file can demand gigabytes: compressed zeros, YAML
aliases, declared sizes and counts. Readers compare what a file declares with these limits before they take memory or
time, and stop unpacking at them. Beyond a limit, a command ends with exit code 2 and names the file, the value and the
limit; `simbev verify` reports a fault, and `simbev repair` lists the loss and saves the rest.

`{limits.MAX_UNPACKED_VARIABLE}` sets `DEFAULT_MAX_UNPACKED_BYTES` to another number of MiB, for example
`{limits.MAX_UNPACKED_VARIABLE}=4096 simbev evaluate predictions.npz datasets/first`. The other limits are fixed.
"""


def render_limits() -> str:
    """The whole page."""
    rows = [(code(name), _amount(name), sentence(text)) for name, text in described_limits()]
    return f"{GENERATED}\n{_INTRODUCTION}\n{table(('limit', 'value', 'of what'), rows)}"


def described_limits() -> Iterator[tuple[str, str]]:
    """Yield name and description of each limit, in the order of the module."""
    body = ast.parse(Path(str(limits.__file__)).read_text(encoding="utf-8")).body
    for assignment, text in pairwise(body):
        match assignment, text:
            case (
                ast.Assign(targets=[ast.Name(id=name)]),
                ast.Expr(value=ast.Constant(value=str(description))),
            ) if isinstance(getattr(limits, name), int):
                yield name, description


def _amount(name: str) -> str:
    """Value of a limit with its unit."""
    value: int = getattr(limits, name)
    if name.endswith("_BYTES"):
        return f"{value >> 20:,} MiB"
    return f"{value:,} px" if name.endswith("_PX") else f"{value:,}"
