"""Values of options that are words with commas between."""

from simbev_ros.foundation.errors import InputError


def different_words(option: str, text: str) -> tuple[str, ...]:
    """Different words that are separated by commas.

    Raises:
        InputError: A word is empty or there twice.
    """
    found = tuple(word.strip() for word in text.split(","))
    if not all(found) or len(set(found)) < len(found):
        raise InputError(f"{text!r} must be different words with commas between", parameter=option)
    return found
