"""Reads from ELF files which shared libraries they need and where the loader looks for them."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from elftools.common.exceptions import ELFError
from elftools.elf.dynamic import DynamicSegment
from elftools.elf.elffile import ELFFile

_MAGIC = b"\x7fELF"


@dataclass(frozen=True, slots=True)
class Linkage:
    """The dynamic section of an ELF file, as far as it names other libraries.

    Attributes:
        needed: Names in DT_NEEDED.
        search_path: Folders of DT_RPATH and DT_RUNPATH, with $ORIGIN resolved.
    """

    needed: tuple[str, ...]
    search_path: tuple[Path, ...]


def read_linkage(path: Path) -> Linkage | None:
    """Read what an ELF file links against; None if it is not an ELF file, is damaged, or links against nothing.

    Raises:
        OSError: The file cannot be read.
    """
    with path.open("rb") as file:
        if file.read(len(_MAGIC)) != _MAGIC:
            return None
        try:
            tags = list(_dynamic_tags(ELFFile(file)))
        except ELFError:
            return None
    if not tags:
        return None
    folders = (folder for kind, value in tags if kind != "needed" for folder in value.split(":") if folder)
    return Linkage(
        tuple(value for kind, value in tags if kind == "needed"),
        tuple(_resolve_origin(folder, path.parent) for folder in folders),
    )


def _dynamic_tags(elf: ELFFile) -> Iterator[tuple[str, str]]:
    """Pairs of needed, rpath or runpath and its text."""
    for segment in elf.iter_segments("PT_DYNAMIC"):
        assert isinstance(segment, DynamicSegment)
        for tag in segment.iter_tags():
            for kind in ("needed", "rpath", "runpath"):
                if tag.entry.d_tag == f"DT_{kind.upper()}":
                    yield kind, getattr(tag, kind)


def _resolve_origin(folder: str, origin: Path) -> Path:
    return Path(folder.replace("${ORIGIN}", str(origin)).replace("$ORIGIN", str(origin))).resolve()
