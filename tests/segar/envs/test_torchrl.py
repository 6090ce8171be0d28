"""TorchRL's face of the engine keeps TorchRL's contract for every registered id."""

import gymnasium
import numpy as np
import pytest
import torch
from tensordict import TensorDict
from torchrl.envs import EnvBase, GymEnv, GymWrapper, TransformedEnv
from torchrl.envs.utils import check_env_specs
from torchrl.record import PixelRenderTransform

import segar
from tests.segar.envs.test_gym import IDS, QUICK


def make(id_: str, num_envs: int = 2) -> segar.envs.TorchRLEnv:
    options = gymnasium.registry[id_].kwargs
    levels = segar.family(options["family_name"]).sample(3, seed=0)
    task = segar.puttputt(options["reward"]) if "reward" in options else None
    return segar.envs.TorchRLEnv(levels, num_envs, observation=options["observation"], task=task, seed=0)


@pytest.mark.parametrize("id_", [pytest.param(id_, marks=[pytest.mark.slow] * (id_ not in QUICK)) for id_ in IDS])
def test_the_specs_describe_what_the_environment_does(id_: str) -> None:
    check_env_specs(make(id_))


def test_a_rollout_is_the_vector_environments_rollout() -> None:
    levels = segar.family("objectsx1-hard").sample(5, seed=0)
    ours = segar.envs.TorchRLEnv(levels, 4, seed=3)
    plain = segar.envs.VectorEnv(levels, 4, seed=3, autoreset_mode="Disabled")
    current, (observations, _) = ours.reset(), plain.reset()
    for step in range(20):
        np.testing.assert_array_equal(current["observation"].numpy(), observations)
        action = np.random.default_rng(step).uniform(-1, 1, (4, 2)).astype(np.float32)
        current = ours.step(TensorDict({"action": torch.from_numpy(action)}, [4]))["next"]
        observations, reward, *_ = plain.step(action)
        np.testing.assert_allclose(current["reward"].numpy()[:, 0], reward, rtol=1e-6)


SHORT = {"num_levels": 3, "max_episode_steps": 9}


def by_id(mode: str, **options) -> EnvBase:
    return GymWrapper(gymnasium.make_vec(QUICK[0], 3, vectorization_mode=mode, **SHORT, **options))


DISABLED = gymnasium.vector.AutoresetMode.DISABLED
GYM = {
    "an id": lambda: GymEnv(QUICK[0], **SHORT),
    "frames of an id": lambda: GymEnv(QUICK[1], **SHORT),
    "pixels": lambda: GymEnv(QUICK[0], **SHORT, from_pixels=True, view=segar.rendering.View(size=64)),
    "repeated actions": lambda: GymEnv(QUICK[0], **SHORT, frame_skip=2),
    "a single environment": lambda: GymWrapper(segar.envs.Env(LEVELS, max_steps=9)),
    "a batch by an id": lambda: by_id("vector_entry_point"),
    "a batch that is reset by TorchRL": lambda: by_id("vector_entry_point", autoreset_mode="Disabled"),
    "a batch of Gymnasium's": lambda: by_id("sync", vector_kwargs={"autoreset_mode": DISABLED}),
    "a batch": lambda: GymWrapper(segar.envs.VectorEnv(LEVELS, 3, max_steps=9, true_factors=False)),
}
LEVELS = segar.family("empty-hard").sample(3, seed=0)


@pytest.mark.parametrize("name", GYM)
def test_torchrls_own_wrappers_take_environments_of_gymnasium(name):
    env = GYM[name]()
    check_env_specs(env)
    env.set_seed(0)
    found = env.rollout(20, break_when_any_done=False)
    assert found["next", "done"].any() and found["next", "reward"].isfinite().all()
    env.close()


def test_frames_for_people_become_an_entry():
    env = segar.envs.TorchRLEnv(LEVELS, 2, render_mode="rgb_array", view=segar.rendering.View(size=64))
    frames = TransformedEnv(env, PixelRenderTransform(out_keys=["frames"])).rollout(3)["next", "frames"]
    assert frames.shape == (2, 3, 64, 64, 3) and frames.dtype == torch.uint8 and (frames[:, 0] != frames[:, 2]).any()
    with pytest.raises(segar.SegarError, match="render_mode='rgb_array'"):
        segar.envs.TorchRLEnv(LEVELS, 2).render()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"autoreset_mode": "NextStep"}, "'autoreset_mode' is not to be chosen"),
        ({"true_factors": True}, "'true_factors' is not to be chosen"),
        ({"observation": {"next": "state"}}, "part cannot be called 'next'"),
    ],
)
def test_options_that_torchrl_decides_are_refused_by_their_names(options, said):
    with pytest.raises(segar.SegarError, match=f"TorchRLEnv: .*{said}"):
        segar.envs.TorchRLEnv(LEVELS, 2, **options)
