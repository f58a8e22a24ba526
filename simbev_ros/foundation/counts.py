"""Numbers with their nouns, for messages, captions and pages."""


def plural(count: int, noun: str) -> str:
    """A number with its noun, such as ``1 scene`` or ``3 scenes``."""
    return f"{count} {noun}{'s' * (count != 1)}"
