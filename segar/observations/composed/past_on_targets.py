"""What observations of the past do on other targets: kernels that change the stacks and the actions of environments."""

from segar.observations.copying import KERNEL_OPTIONS
from segar.support import cached

SIZES: dict[str, tuple[str | None, ...]] = {
    **{"drawn": ("envs", None), "fresh": ("envs",), "stacks": ("envs", None, None, None), "past": ("envs", None)},
}
"""Names of the sizes of what these kernels are called with."""
DRAWN = {"frames": "drawn", "out": "drawn", "mask": "drawn_mask"}
"""Arguments of a call that writes an observation, and what they are called where it is written to be stacked. All are
``drawn``."""


@cached(**KERNEL_OPTIONS)
def mark_stacks(rows, is_fresh, fresh):
    """Note of environments ``rows`` whether their next frame fills the stack."""
    for r in range(len(rows)):
        fresh[rows[r]] = is_fresh


@cached(**KERNEL_OPTIONS)
def advance_stacks(things, parts, stacks):
    """Make the frames one older: part ``k % parts`` of environment ``k // parts`` for each k of ``things``."""
    for t in range(len(things)):
        env, part = things[t] // parts, things[t] % parts
        first, last = part * stacks.shape[3] // parts, (part + 1) * stacks.shape[3] // parts
        for frame in range(stacks.shape[1] - 1):
            for plane in range(stacks.shape[2]):
                for pixel in range(first, last):
                    stacks[env, frame, plane, pixel] = stacks[env, frame + 1, plane, pixel]


@cached(**KERNEL_OPTIONS)
def write_stacks(things, parts, is_drawn_turned, is_turned, drawn, fresh, stacks, out):
    """Take the newest frames from ``drawn``, all frames where the stack is ``fresh``, and write the stacks into ``out``, in
    parts as :func:`advance_stacks`.

    Args:
        is_drawn_turned: whether the planes of a pixel are neighbours in ``drawn``; otherwise the pixels of a plane are.
        is_turned: whether the planes of all n frames of a pixel are neighbours in ``out``.
        drawn: ``[env, pixel * plane]``, the newest frames, as the stacked observation writes them.
        fresh: bool ``[env]``, whether the next frame fills the stack.
        stacks: ``[env, n, plane, pixel]``, the newest frame last. What is not joined along its last axis is one plane.
    """
    n, planes, pixels = stacks.shape[1], stacks.shape[2], stacks.shape[3]
    for t in range(len(things)):
        env, part = things[t] // parts, things[t] % parts
        for pixel in range(part * pixels // parts, (part + 1) * pixels // parts):
            for frame in range(n):
                for plane in range(planes):
                    if frame == n - 1 or fresh[env]:
                        at = pixel * planes + plane if is_drawn_turned else plane * pixels + pixel
                        stacks[env, frame, plane, pixel] = drawn[env, at]
                    joined = frame * planes + plane
                    to = pixel * n * planes + joined if is_turned else joined * pixels + pixel
                    out[env, to] = stacks[env, frame, plane, pixel]


@cached(**KERNEL_OPTIONS)
def forget_actions(rows, past):
    """Forget the actions of environments ``rows``."""
    for r in range(len(rows)):
        for k in range(past.shape[1]):
            past[rows[r], k] = 0.0


@cached(**KERNEL_OPTIONS)
def note_actions(rows, actions, low, high, past):
    """Remember the clipped ``actions`` of environments ``rows``, and forget the oldest."""
    size = actions.shape[1]
    for r in range(len(rows)):
        env = rows[r]
        for k in range(past.shape[1] - size):
            past[env, k] = past[env, k + size]
        for k in range(size):
            past[env, past.shape[1] - size + k] = min(max(actions[env, k], low[k]), high[k])


@cached(**KERNEL_OPTIONS)
def show_actions(rows, past, out):
    """Write the actions that environments ``rows`` remember."""
    for r in range(len(rows)):
        for k in range(past.shape[1]):
            out[rows[r], k] = past[rows[r], k]
