"""The option ``--cache`` of commands that read what baselines see, and the filling of the cache."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from simbev_ros.baselines.modality import Modality
from simbev_ros.cli.agent_option import require_agent
from simbev_ros.cli.console import counting_bar
from simbev_ros.dataset.parallel import Processes

Cache = Annotated[
    Path | None,
    typer.Option(
        help="Folder of the cache; by default next to the dataset, with the agent, if given, and .cache at its end.",
        show_default=False,
    ),
]


def filled_cache(
    dataset: Path,
    cache: Path | None,
    modality: Modality,
    pool: Processes,
    console: Console,
    agent: str | None = None,
) -> Path:
    """Write what the cache lacks of a dataset, with a progress bar; return its folder.

    Args:
        dataset: The dataset.
        cache: Folder of the cache; None: next to the dataset.
        modality: What models see.
        pool: Processes that write it.
        console: Where to show the progress.
        agent: Agent with the data that models see; None: the first one of each scene.

    Raises:
        InputError: No scene has the agent, or the dataset cannot be read, or does not suit the baselines.
    """
    from simbev_ros.dataset import open_dataset
    from simbev_training.cache.writer import write_cache

    if agent is not None:
        require_agent(agent, open_dataset(dataset, threads=1).agents, dataset)
    name = ".".join([dataset.absolute().name, *([] if agent is None else [agent]), "cache"])
    folder = dataset.absolute().with_name(name) if cache is None else cache
    with counting_bar("scenes in the cache", console) as bar:
        for done, total in write_cache(dataset, folder, pool, modality, agent=agent):
            bar.show(done, total)
    return folder
