"""``segar record``: episodes into a dataset with frames and true factors, or one episode into a video."""

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np

from segar.cli import arguments
from segar.datasets import Policy, check_replay, minari_place, record, to_minari
from segar.envs import Env
from segar.errors import SegarError
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
    arguments.add_output(made, "a folder; or a file, .mp4 or .gif", required=True, metavar="PLACE")
    arguments.add_number(made, "--episodes", "of the dataset", least=1, default=100)
    made.add_argument("--policy", choices=POLICIES, default="uniform", help="who plays (default: %(default)s)")
    made.add_argument("--observation", choices=list(OBSERVATIONS), default="rgb", help="(default: %(default)s)")
    made.add_argument("--task", help=arguments.TASK_HELP)
    arguments.add_number(made, "--shard", "episodes per file", least=1, default=64)
    arguments.add_number(made, "--trials", "episodes of the dataset in a row on each level", least=1, default=1)
    made.add_argument("--minari", metavar="ID", help="also write a Minari dataset, e.g. segar/empty-hard-v0")
    made.add_argument("--check", action="store_true", help="play all again and compare")
    arguments.add_number(made, "--level", "of the video", least=0, default=0)
    arguments.add_number(made, "--size", "of the video's arena [px]", least=64, default=512)


def run(chosen: argparse.Namespace) -> None:
    """``segar record``."""
    is_video = _is_video(chosen.output)
    if is_video and (chosen.minari or chosen.check or chosen.trials > 1):
        raise SegarError(
            f"--minari, --check and --trials are for datasets, and {chosen.output} is a video; name a folder"
        )
    if chosen.minari is not None:
        minari_place(chosen.minari)  # before hours of recording
    levels = arguments.sampled_levels(chosen)
    task = arguments.task_named(chosen.task, levels)
    if is_video:
        record_video(chosen, levels, task)
        return
    dataset = record(
        chosen.output,
        levels,
        scripted(task) if chosen.policy == "script" else None,
        episodes=chosen.episodes,
        observation=chosen.observation,
        task=task,
        seed=chosen.seed,
        episodes_per_shard=chosen.shard,
        trials=chosen.trials,
        policy_name=chosen.policy,
        progress=None if chosen.json else show_progress,
    )
    answer = {"folder": chosen.output, "episodes": len(dataset), "steps": dataset.steps, "frames": dataset.rows}
    answer["shards"] = len(dataset.manifest.shards)
    if chosen.check:
        answer["steps_replayed"] = check_replay(dataset, task=task)
    if chosen.minari is not None:
        answer["minari"] = to_minari(dataset, chosen.minari).id
    arguments.print_answer(chosen, answer, ", ".join(f"{name} {value}" for name, value in answer.items()))


def _is_video(output: str) -> bool:
    """Whether a place is a video's; raises :class:`SegarError` where it looks like a file of another kind."""
    suffix = Path(output).suffix
    if suffix.lower() in video.FORMATS:
        return True
    if suffix[1:2].isalpha() and not output.endswith("/") and not Path(output).is_dir():
        raise SegarError(f"a video is .mp4 or .gif, not '{output}'; a folder with such a name is '{output}/'")
    return False


def record_video(chosen: argparse.Namespace, levels: Levels, task: Task) -> None:
    """Record one episode as people see it."""
    level = chosen.level % len(levels)
    env = Env(levels, task=task, seed=chosen.seed, render_mode="rgb_array", view=View(size=chosen.size))
    rng = np.random.default_rng(chosen.seed)
    policy = scripted(task) if chosen.policy == "script" else None
    play = None if policy is None else lambda observation, info: policy(observation, info, rng)
    frames = video.record(env, chosen.output, play, seed=chosen.seed, options={"level": level})
    answer = {"file": chosen.output, "level": level, "frames": frames, "frames_per_second": env.metadata["render_fps"]}
    arguments.print_answer(chosen, answer, f"{chosen.output}: {frames} frames of level {level}")


def scripted(task: Task) -> Policy:
    """The scripted player of a task as a policy; raises :class:`SegarError` where there is none."""
    if task.demo_actions is None:
        raise SegarError(
            f"task {task.name} has no scripted player. Give the task demo_actions=, a function of info['factors'] that returns"
            " actions of shape (num_envs, action size); or record with --policy uniform"
        )
    return lambda observations, info, rng: task.scripted_actions(info["factors"])


def show_progress(done: int, shards: int) -> None:
    """A line that is written over."""
    if sys.stderr.isatty():
        print(f"\r{done} of {shards} shards", end="\n" if done == shards else "", file=sys.stderr, flush=True)
