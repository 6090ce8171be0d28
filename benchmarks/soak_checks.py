"""What must hold at the end of every sub-step, whatever was played: one array operation for a whole batch."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from segar.engine.runtime.contacts import MAX_CONTACTS
from segar.engine.simulator import State
from segar.language.factors import Alive, Collides, Done, Mobile, Position, Size, Velocity
from segar.language.layout import holds
from segar.levels.level_set import Levels

TOLERANCE = 1e-6  # [m] by which bodies may overlap each other and the walls


class Checks:
    """The laws of one level set, in a world whose walls stand at plus and minus ``walls`` [m].

    Nothing becomes nan or infinite, no factor appears where there was none; bodies stay inside the arena; solid bodies do
    not overlap. Of the last there are two exceptions: ``unresolved_contacts`` counts the
    sub-steps that had more than 64 contacts, and bodies that cannot move stay where they are.
    """

    def __init__(self, levels: Levels, walls: float = 1.0) -> None:
        layout = levels.layout
        self.columns, self.walls = layout.columns, walls
        collides = np.array([all(holds(t, f) for f in (Collides, Position, Velocity)) for t in layout.types] + [False])
        is_body = collides[levels.types]
        self.slots = np.flatnonzero(is_body.any(axis=0))
        self.is_body = is_body[:, self.slots]
        self.is_circle = levels.shape_kind[:, self.slots] == 1
        self.hull_radius = np.sqrt((levels.vertices**2).sum(-1)).max(-1, initial=0.0)[:, self.slots]
        self.lacks = np.isnan(levels.values)
        self.first, self.second = np.triu_indices(len(self.slots), 1)

    def depths(self, state: State) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """How deep the two bodies that overlap most reach into each other, how far the outermost body reaches beyond the
        walls [m], and how many pairs of immobile bodies overlap; each ``(num_envs,)``, -inf where there is no body."""
        body = self.is_body[state.level]
        x, alive, done, mobile, size = (self._read(state, f) for f in (Position, Alive, Done, Mobile, Size))
        r = np.where(self.is_circle[state.level], 0.5 * size[..., 0], self.hull_radius[state.level])
        outside = np.where(body, np.abs(x).max(axis=-1) + r - self.walls, -np.inf)
        solid = body & (alive[..., 0] != 0) & (done[..., 0] == 0)
        a, b = self.first, self.second
        between = x[:, a] - x[:, b]
        depth = r[:, a] + r[:, b] - np.sqrt((between * between).sum(axis=-1))
        met = solid[:, a] & solid[:, b]
        free = (mobile[:, a, 0] != 0) | (mobile[:, b, 0] != 0)
        overlap = np.where(met & free, depth, -np.inf).max(axis=1, initial=-np.inf)
        fixed = (met & ~free & (depth > TOLERANCE)).sum(axis=1)
        return overlap, outside.max(axis=1, initial=-np.inf), fixed

    def strange(self, state: State) -> np.ndarray:
        """Where a number is nan or infinite that was not, or is there that was not; bool ``(num_envs,)``."""
        lacks = self.lacks[state.level]
        return (np.isfinite(state.values) == lacks).any(axis=(1, 2))

    def faults(self, state: State, before: State, sub_steps: int) -> Iterator[tuple[int, str]]:
        """Environment and description of all that must not be, after that many sub-steps from ``before``."""
        overlap, outside, _ = self.depths(state)
        unresolved_contacts, contacts = (
            state.unresolved_contacts - before.unresolved_contacts,
            state.contacts - before.contacts,
        )
        for env in np.flatnonzero((overlap > TOLERANCE) & (unresolved_contacts == 0)):
            yield int(env), f"two bodies overlap by {overlap[env]:.1e} m"
        for env in np.flatnonzero(outside > TOLERANCE):
            yield int(env), f"a body reaches {outside[env]:.1e} m beyond a wall"
        for env in np.flatnonzero(
            (contacts < 0) | (contacts > MAX_CONTACTS * sub_steps) | (unresolved_contacts > sub_steps)
        ):
            yield (
                int(env),
                f"{contacts[env]} contacts and {unresolved_contacts[env]} times given up in {sub_steps} sub-steps",
            )

    def _read(self, state: State, factor: type) -> np.ndarray:
        """A factor of the bodies, ``(num_envs, bodies, width)``."""
        column = self.columns[factor]
        return state.values[:, self.slots, column : column + factor.width]
