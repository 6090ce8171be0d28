"""The names of the level distributions that come with SEGAR; :mod:`segar.levels.named_families` makes them."""

DIFFICULTIES = ("easy", "medium", "hard")
TASKS_OF_2022 = ("empty", "objectsx1", "objectsx2", "objectsx3", "tilesx1", "tilesx2", "tilesx3")
TASKS = (*TASKS_OF_2022, "hazardtilesx1", "hazardtilesx2", "hazardtilesx3")
TASK_LEVELS = ("puttputt", "puttputt-random-middle", "billiards", "invisiball")


def families() -> tuple[str, ...]:
    """Names of the 30 families: task x difficulty.

    >>> segar.families()[:3]
    ('empty-easy', 'empty-medium', 'empty-hard')
    """
    return tuple(f"{task}-{difficulty}" for task in TASKS for difficulty in DIFFICULTIES)
