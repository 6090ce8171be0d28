"""``segar record``: episodes into a Minari dataset with frames and true factors, or one episode into a video."""

import argparse
import sys
from pathlib import Path
from typing import Any

from segar.cli import arguments
from segar.datasets import check_replay, record
from segar.envs import Env
from segar.errors import SegarError
from segar.evaluation import Scripted
from segar.language import Task
from segar.levels import Levels
from segar.observations import OBSERVATIONS
from segar.rendering import View, video

POLICIES = ("uniform", "script")


def add_commands(commands: Any) -> None:
    """Add ``record`` to the sub-commands of a parser."""
    made = arguments.command(
        commands, "record", run, "record episodes: a dataset with frames and factors, or a video of one episode"
    )
    arguments.add_levels(made, "levels and episodes")
    place = "the name of a Minari dataset, e.g. segar/rolling-v0; or a file, .mp4 or .gif"
    arguments.add_output(made, place, required=True)
    arguments.add_number(made, "--episodes", "of the dataset", least=1, default=100)
    made.add_argument("--policy", choices=POLICIES, default="uniform", help="who plays (default: %(default)s)")
    made.add_argument("--observation", choices=list(OBSERVATIONS), default="rgb", help="(default: %(default)s)")
    made.add_argument("--task", help=arguments.TASK_HELP)
    arguments.add_number(made, "--batch", "episodes of the dataset side by side", least=1, default=64)
    arguments.add_number(made, "--trials", "episodes of the dataset in a row on each level", least=1, default=1)
    made.add_argument("--check", action="store_true", help="play all again and compare")
    arguments.add_number(made, "--level", "of the video", least=0, default=0)
    arguments.add_number(made, "--size", "of the video's arena [px]", least=64, default=512)


def run(chosen: argparse.Namespace) -> None:
    """``segar record``."""
    is_video = Path(chosen.output).suffix.lower() in video.FORMATS
    if is_video and (chosen.check or chosen.trials > 1):
        raise SegarError(f"--check and --trials are for datasets, and {chosen.output} is a video; name a dataset")
    if is_video:
        video.check_video(Path(chosen.output))
    levels = arguments.sampled_levels(chosen)
    task = arguments.task_named(chosen.task, levels)
    if is_video:
        record_video(chosen, levels, task)
        return
    dataset = record(
        chosen.output,
        levels,
        Scripted() if chosen.policy == "script" else None,
        episodes=chosen.episodes,
        observation=chosen.observation,
        task=task,
        seed=chosen.seed,
        batch=chosen.batch,
        trials=chosen.trials,
        policy_name=chosen.policy,
        progress=None if chosen.json else show_progress,
    )
    answer = {"dataset": dataset.id, "episodes": dataset.total_episodes, "steps": int(dataset.total_steps)}
    if chosen.check:
        answer["steps_replayed"] = check_replay(dataset, task=task, world=levels.world)
    arguments.print_answer(chosen, answer, ", ".join(f"{name} {value}" for name, value in answer.items()))


def record_video(chosen: argparse.Namespace, levels: Levels, task: Task) -> None:
    """Record one episode as people see it."""
    level = chosen.level % len(levels)
    env = Env(levels, task=task, seed=chosen.seed, render_mode="rgb_array", view=View(size=chosen.size))
    play = (lambda observation, info: task.scripted_actions(env.factors)) if chosen.policy == "script" else None
    frames = video.record(env, chosen.output, play, seed=chosen.seed, options={"level": level})
    answer = {"file": chosen.output, "level": level, "frames": frames, "frames_per_second": env.metadata["render_fps"]}
    arguments.print_answer(chosen, answer, f"{chosen.output}: {frames} frames of level {level}")


def show_progress(done: int, episodes: int) -> None:
    """A line that is written over."""
    if sys.stderr.isatty():
        print(f"\r{done} of {episodes} episodes", end="\n" if done == episodes else "", file=sys.stderr, flush=True)
