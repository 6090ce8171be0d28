"""The replay: what is drawn is a step that was made, whole, whatever was overwritten; and it survives a checkpoint."""

import io

import pytest
import torch

from segar.experiments.collection.replay import CHUNK, Replay, pack_frames, unpack_frames


class Walk:
    """Environments that count: an observation is a number that no other observation has."""

    def __init__(self, num_envs, seed=0, frames=False):
        self.rng = torch.Generator().manual_seed(seed)
        self.count, self.num_envs, self.frames = 0, num_envs, frames
        self.current = self.fresh(num_envs)
        self.steps = []  # (number before, number after, reward, terminated), in order

    def fresh(self, n):
        self.count += n
        return torch.arange(self.count - n, self.count)

    def seen(self, numbers):
        if not self.frames:
            return numbers.float()[:, None]
        bytes_ = torch.stack([(numbers >> shift) & 255 for shift in (0, 8, 16)], -1).to(torch.uint8)
        return bytes_[:, None, None, :].expand(-1, 4, 4, -1).contiguous()

    def step(self, replay):
        after = self.fresh(self.num_envs)
        done = torch.rand(self.num_envs, 1, generator=self.rng) < 0.3
        terminated = done & (torch.rand(self.num_envs, 1, generator=self.rng) < 0.5)
        reward = torch.randn(self.num_envs, 1, generator=self.rng)
        u = self.current.float()[:, None] * torch.tensor([1.0, -1.0])
        replay.add(self.seen(self.current), u, reward, terminated, done, self.seen(after))
        made = zip(self.current.tolist(), after.tolist(), reward[:, 0].tolist(), terminated[:, 0].tolist(), strict=True)
        self.steps.extend((*one, ended) for one, ended in zip(made, done[:, 0].tolist(), strict=True))
        self.current = torch.where(done[:, 0], self.fresh(self.num_envs), after)


def replay_of(capacity, num_envs, seed=0):
    return Replay(capacity, num_envs, torch.Generator().manual_seed(seed))


def drawn(replay, size=4000):
    batch = replay.sample(size)
    columns = (
        batch["observation"][:, 0].long(),
        batch["next", "observation"][:, 0].long(),
        batch["next", "reward"][:, 0],
        batch["next", "terminated"][:, 0],
        batch["next", "done"][:, 0],
    )
    assert torch.equal(batch["u"][:, 0].long(), columns[0]) and torch.equal(batch["u"][:, 1].long(), -columns[0])
    return set(zip(*(c.tolist() for c in columns), strict=True))


@pytest.mark.parametrize("num_envs", [1, 3, 8])
@pytest.mark.parametrize("steps", [5, 40])
def test_every_step_can_be_drawn_and_what_is_drawn_was_made(num_envs, steps):
    """Those that go on wait for their next observation, which comes with the next step; those that ended do not."""
    replay, walk = replay_of(1000, num_envs), Walk(num_envs)
    for _ in range(steps):
        walk.step(replay)
    latest = walk.steps[-num_envs:]
    expected = set(walk.steps[:-num_envs]) | {step for step in latest if step[4]}
    assert drawn(replay) == expected
    assert len(replay) == len(expected)


@pytest.mark.parametrize("capacity", [12, 13, 50])
def test_a_full_replay_forgets_the_oldest_and_never_mixes(capacity):
    replay, walk = replay_of(capacity, 3), Walk(3)
    for k in range(100):
        walk.step(replay)
        if k < 1:
            continue
        found = drawn(replay, 300)
        assert found <= set(walk.steps)
        oldest = min(walk.steps.index(step) for step in found)
        assert len(walk.steps) - oldest <= capacity
    assert len(found) >= capacity - 3 - capacity // 2  # the rest: last observations, and steps that wait


def test_draws_are_uniform_over_steps():
    replay, walk = replay_of(100, 2), Walk(2)
    for _ in range(20):
        walk.step(replay)
    numbers = replay.sample(50_000)["observation"][:, 0].long()
    counts = torch.bincount(numbers)[numbers.unique()].float()
    expected = 50_000 / len(replay)
    assert len(counts) == len(replay)
    chi_squared = ((counts - expected) ** 2 / expected).sum()
    freedom = len(replay) - 1
    assert chi_squared < freedom + 5 * (2 * freedom) ** 0.5


@pytest.mark.parametrize("frames", [False, True])
@pytest.mark.parametrize("steps", [0, 10, 400])
def test_a_replay_goes_on_from_a_checkpoint_as_if_nothing_had_happened(frames, steps):
    def made(seed):
        return replay_of(1000, 3, seed), Walk(3, frames=frames)

    (replay, walk), (other, _) = made(0), made(1)
    for _ in range(steps):
        walk.step(replay)
    stored = io.BytesIO()
    torch.save({"replay": replay.state_dict(), "rng": replay.buffer.sampler._rng.get_state()}, stored)
    stored.seek(0)
    state = torch.load(stored, weights_only=True)
    for _ in range(5):  # it holds something else before
        Walk(3, seed=5, frames=frames).step(other)
    other.load_state_dict(state["replay"])
    other.buffer.sampler._rng.set_state(state["rng"])
    twin = Walk(3, frames=frames)
    twin.__dict__.update({**walk.__dict__, "rng": torch.Generator(), "steps": []})
    twin.rng.set_state(walk.rng.get_state())
    for _ in range(20):
        walk.step(replay)
        twin.step(other)
        a, b = replay.sample(32), other.sample(32)
        assert (a == b).all()


def test_frames_are_stored_once_and_compressed_once(monkeypatch):
    replay, walk = replay_of(4 * CHUNK, 4), Walk(4, frames=True)
    for _ in range(CHUNK // 2):
        walk.step(replay)
    rows = replay.written
    assert rows < 1.5 * len(walk.steps)
    calls = []
    monkeypatch.setattr(
        "segar.experiments.collection.replay.pack_frames", lambda f, s: calls.append(len(f)) or pack_frames(f, s)
    )
    replay.state_dict()
    first = len(calls)
    assert sum(calls) == rows
    walk.step(replay)
    replay.state_dict()
    assert len(calls) == first + 1


@pytest.mark.parametrize("n", [1, 3, 4, 5, 17])
def test_packed_frames_are_the_frames(n):
    frames = torch.randint(0, 256, (n, 5, 6, 3), dtype=torch.uint8, generator=torch.Generator().manual_seed(0))
    assert torch.equal(unpack_frames(pack_frames(frames, 4), [5, 6, 3], 4), frames)


def test_frames_that_change_little_take_little_room():
    frames = torch.zeros(256, 64, 64, 3, dtype=torch.uint8)
    frames[:] = torch.randint(0, 256, (64, 64, 3), dtype=torch.uint8, generator=torch.Generator().manual_seed(0))
    for k in range(256):
        frames[k, k % 60 : k % 60 + 4, 20:24] = 255
    assert len(pack_frames(frames, 1)) < frames.numel() / 50
