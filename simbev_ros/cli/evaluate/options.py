"""Parses the command-line options of ``simbev evaluate``."""

import math
from collections.abc import Sequence

from simbev_ros.cli.agent_option import require_agent
from simbev_ros.config.evaluation import answer_topics_of
from simbev_ros.dataset import Dataset, Scene
from simbev_ros.evaluation.conditions import DAYTIMES, WEATHERS
from simbev_ros.evaluation.filters import BoxFilter
from simbev_ros.evaluation.slices import TableSlice
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.semantics import BEV_CLASSES, BOX_CLASSES, DIFFICULTIES


def comma_separated(option: str, text: str) -> tuple[str, ...]:
    """Parse words that are separated by commas.

    Raises:
        InputError: A word is empty.
    """
    found = tuple(word.strip() for word in text.split(","))
    if not all(found):
        raise InputError(f"{option}: {text!r}: must be words with commas between")
    return found


def numbers(option: str, text: str) -> tuple[float, ...]:
    """Parse finite numbers that are separated by commas.

    Raises:
        InputError: A word is not a finite number.
    """
    return tuple(_number(option, word) for word in comma_separated(option, text))


def span(option: str, text: str) -> tuple[float, float]:
    """Parse an interval ``FROM:TO``, which by default begins at 0 and has no end.

    Raises:
        InputError: The text is not an interval.
    """
    low, colon, high = text.partition(":")
    if not colon:
        raise InputError(f"{option}: {text!r}: must be FROM:TO, as 0:50 or 20:")
    return _number(option, low) if low else 0.0, _number(option, high) if high else math.inf


def thresholds(option: str, text: str, most: float) -> tuple[float, ...]:
    """Parse positive, increasing numbers up to a limit; ``none``: an empty list.

    Raises:
        InputError: A number is wrong.
    """
    if text == "none":
        return ()
    found = numbers(option, text)
    if not all(0 < each <= most for each in found) or list(found) != sorted(set(found)):
        raise InputError(f"{option}: {text}: must rise, and each be above 0 and at most {most:g}")
    return found


def classes(option: str, text: str | None) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Parse names of classes into those of boxes and those of cells; None: all.

    Raises:
        InputError: A class does not exist.
    """
    if text is None:
        return BOX_CLASSES, BEV_CLASSES
    chosen = comma_separated(option, text)
    known = tuple(dict.fromkeys((*BOX_CLASSES, *BEV_CLASSES)))
    strange = [name for name in chosen if name not in known]
    if strange:
        raise InputError(f"{option}: there is no {strange[0]!r}; allowed: {', '.join(known)}")
    return tuple(n for n in BOX_CLASSES if n in chosen), tuple(n for n in BEV_CLASSES if n in chosen)


def counted(
    *, distance: str, visibility: float, points: int, difficulty: str | None, daytime: str | None, weather: str | None
) -> TableSlice:
    """Parse the conditions on boxes and frames that are evaluated at all; None: no condition.

    Raises:
        InputError: A condition is malformed or excludes everything.
    """
    boxes = BoxFilter(
        range_m=span("--range", distance),
        visibility=(visibility, math.inf),
        points=(points, math.inf),
        difficulties=comma_separated("--difficulty", difficulty) if difficulty else DIFFICULTIES,
    )
    return TableSlice(
        boxes=boxes,
        daytimes=comma_separated("--daytime", daytime) if daytime else DAYTIMES,
        weathers=comma_separated("--weather", weather) if weather else WEATHERS,
    )


def chosen_scenes(dataset: Dataset, split: str | None, names: str | None, agent: str | None = None) -> Sequence[Scene]:
    """The scenes of a dataset with a split, names and an agent, as it sees them; None: any, as the first agent.

    Raises:
        InputError: A scene does not exist, or none is left.
    """
    wanted = None if names is None else comma_separated("--scenes", names)
    known = [scene.name for scene in dataset.scenes]
    for name in wanted or ():
        if name not in known:
            raise InputError(f"--scenes: {dataset.path} has no scene {name!r}, but {', '.join(known[:10]) or 'none'}")
    scenes = [s for s in dataset.scenes if split in (None, s.split) and (wanted is None or s.name in wanted)]
    if not scenes:
        of_split = "" if split is None else f" of the split {split!r}"
        raise InputError(f"{dataset.path}: there is no scene{of_split} to evaluate")
    if agent is None:
        return scenes
    require_agent(agent, sorted({name for scene in scenes for name in scene.agents}), dataset.path)
    return [scene.of_agent(agent) for scene in scenes if agent in scene.agents]


def answer_topics(scenes: Sequence[Scene], agent: str | None) -> tuple[str, str]:
    """Usual topics of boxes and of grids for an agent of the scenes (None: the first one)."""
    if agent is None or all(scene.spec is scene.spec.whole for scene in scenes):
        return answer_topics_of("")
    return answer_topics_of(agent)


def _number(option: str, word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{option}: {word!r} is not a number")
    return value
