"""What environments do as calls of compiled functions, for other targets than this processor."""

from dataclasses import dataclass

from segar.engine import Call, Entry, TargetKernel, build_kernel, described_world, step_entry
from segar.envs.episode_calls import observation_calls, start_call
from segar.envs.vector import VectorEnv


@dataclass(frozen=True)
class EnvironmentCalls:
    """The calls of an environment, in the order in which they are made.

    Attributes:
        step: the entry of a step; its arrays are those of :func:`segar.engine.step_entry`.
        start: start episodes on levels, and what their observations need.
        advance: let the observations note a step, after it; empty where they show nothing of the past.
        write: write the observations of the present states.
    """

    step: Entry
    start: tuple[Call, ...]
    advance: tuple[Call, ...]
    write: tuple[Call, ...]


def environment_calls(env: VectorEnv) -> EnvironmentCalls:
    """What an environment does, as calls; with these, another target plays the same episodes to the bit.

    Raises:
        SegarError: its observation is not made by compiled functions alone.
    """
    advice = "give it a method calls(when) as in segar.observations.protocol.RunsOnTargets"
    start, advance, write = observation_calls(env.observation, "other targets", advice)
    step = step_entry(env.simulator.world, env.levels.layout, env.task)
    return EnvironmentCalls(step, (start_call(env.levels, env.trials), *start), advance, write)


def build_environment(env: VectorEnv, target: str) -> TargetKernel:
    """The module of a target with all that an environment does; see :func:`segar.engine.build_kernel`.

    Its description also says which entities, factors and parameters there are, and what the task's actions are.

    Raises:
        SegarError: the target, or something for it, does not exist; the message names it.
    """
    calls = environment_calls(env)
    entries = dict.fromkeys(call.entry for call in (*calls.start, *calls.advance, *calls.write))
    return build_kernel([calls.step, *entries], target, described_world(env.levels.layout, env.task))
