"""Options that are lists of numbers, such as ``1,2,4``."""

from simbev_ros.foundation.errors import InputError


def numbers_in(text: str, option: str, largest: int, smallest: int = 1) -> list[int]:
    """The numbers of an option, which are separated by commas.

    Args:
        text: Value of the option.
        option: Its name, for messages.
        largest: Largest number that is allowed.
        smallest: Smallest number that is allowed.

    Raises:
        InputError: Something else is in the list.
    """
    numbers = [each.strip() for each in text.split(",")]
    digits = len(str(largest))
    if not all(
        each.isascii() and each.isdecimal() and smallest <= int(each[: digits + 1]) <= largest for each in numbers
    ):
        raise InputError(
            f"{option}: must be numbers from {smallest} to {largest}, separated by commas, not {text!r:.80}"
        )
    return [int(each) for each in numbers]
