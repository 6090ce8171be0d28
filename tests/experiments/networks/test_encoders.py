"""Encoders: what their docstrings say of shapes and sizes, frames that are not copied, and bfloat16 that agrees."""

import re

import pytest
import torch
from torch import nn

from segar.experiments.algorithms.ppo import PPOPolicy
from segar.experiments.networks import encoders
from segar.experiments.networks.encoders import MLP, FrameEncoder, initialize, make_encoder, successive
from segar.experiments.networks.keypoints import SoftArgmax, squares_by_torch
from segar.experiments.networks.shared_frames import are_stacks_by_torch
from segar.experiments.settings import ConfigError, PPOConfig
from segar.experiments.settings.algorithms import CNNS

NETWORKS = [name for name in CNNS if name != "cnn_2022"]  # of these all representations have 256 numbers
FRAMES = torch.randint(0, 256, (6, 64, 64, 3), dtype=torch.uint8, generator=torch.Generator().manual_seed(0))


def encoder(name, precision="fp32", shape=(64, 64, 3), seed=0):
    one = make_encoder(PPOConfig(encoder=name, precision=precision), shape)
    initialize(one, torch.Generator().manual_seed(seed))
    return one


def parameters(module):
    return sum(p.numel() for p in module.parameters())


@pytest.mark.parametrize("name", CNNS)
def test_a_cnn_has_as_many_parameters_as_its_docstring_says(name):
    (stated,) = re.findall(r"(\d+ \d+) parameters", getattr(encoders, name).__doc__)
    assert parameters(encoder(name)) == int(stated.replace(" ", ""))


@pytest.mark.parametrize(
    ("name", "width"), [("cnn_2022", 4096), ("tests.experiments.networks.test_encoders:pooled", 12)]
)
def test_heads_read_representations_of_any_width(name, width):
    policy = PPOPolicy(PPOConfig(encoder=name), (64, 64, 3), 2)
    assert policy.actor.encoder.width == width and policy.actor.encoder.training
    loc, _, value = policy(FRAMES)
    assert (loc.shape, value.shape) == ((6, 2), (6, 1))
    assert policy.represent(FRAMES.numpy()).shape == (6, width)


def pooled(height, width, depth):
    """A CNN of one's own."""
    return nn.Sequential(nn.AdaptiveAvgPool2d(2), nn.Flatten(), nn.BatchNorm1d(4 * depth), nn.ReLU())


@pytest.mark.parametrize("name", NETWORKS)
def test_a_cnn_gives_256_float32_numbers_that_are_not_negative_whatever_stands_in_front(name):
    one = encoder(name, "bf16")
    flat = one(FRAMES)
    assert flat.shape == (6, one.width) == (6, 256)
    assert flat.dtype == torch.float32
    assert flat.min() == 0.0
    torch.testing.assert_close(one(FRAMES.unflatten(0, (2, 3))), flat.unflatten(0, (2, 3)))
    torch.testing.assert_close(one(FRAMES[0]), one(FRAMES[:1])[0])


@pytest.mark.parametrize("name", NETWORKS)
def test_weights_are_glorot_uniform_and_biases_zero(name):
    for layer in encoder(name).modules():
        if isinstance(layer, nn.Conv2d | nn.Linear):
            fan_in, fan_out = nn.init._calculate_fan_in_and_fan_out(layer.weight)
            bound = (6 / (fan_in + fan_out)) ** 0.5
            assert layer.weight.abs().max().item() <= bound
            assert layer.weight.std().item() == pytest.approx(bound / 3**0.5, rel=0.1)
            assert not layer.bias.any()


@pytest.mark.parametrize("name", NETWORKS)
def test_bfloat16_agrees_with_float32_and_its_weights_and_gradients_are_float32(name):
    exact, fast = encoder(name, "fp32"), encoder(name, "bf16")
    torch.testing.assert_close(fast(FRAMES), exact(FRAMES), atol=0.02, rtol=0.02)
    directions = []
    for one in (exact, fast):
        one(FRAMES).square().sum().backward()
        assert all(p.grad.dtype == torch.float32 for p in one.parameters())
        directions.append(torch.cat([p.grad.flatten() for p in one.parameters()]))
    assert torch.cosine_similarity(*directions, dim=0) > 0.98


@pytest.mark.parametrize("precision", ["bf16", "fp32"])
def test_frames_reach_the_cnn_with_channels_last_and_between_0_and_1(precision):
    seen = []

    class Look(nn.Module):
        def forward(self, x):
            seen.append(x)
            return x.flatten(1)

    one = FrameEncoder(Look(), precision)
    one(FRAMES)
    assert seen[0].shape == (6, 3, 64, 64)
    assert seen[0].is_contiguous(memory_format=torch.channels_last)
    torch.testing.assert_close(seen[0].permute(0, 2, 3, 1).float(), FRAMES.float() / 255, atol=4e-3, rtol=0)


def test_vectors_are_read_by_an_mlp_whatever_the_cnn():
    for name in (*CNNS, "mlp"):
        one = make_encoder(PPOConfig(encoder=name, widths=(32, 16)), (9,))
        assert isinstance(one, MLP)
        assert one(torch.zeros(5, 9)).shape == (5, one.width) == (5, 16)


@pytest.mark.parametrize(
    ("name", "shape", "says"),
    [
        ("mlp", (64, 64, 3), r"'mlp' cannot read \[64, 64, 3\]; an MLP reads vectors"),
        ("impala", (2, 3), r"'impala' cannot read \[2, 3\]; vectors are \[d\], frames \[height, width, depth\]"),
        ("small", (20, 20, 3), "'small' cannot read 20 x 20 frames: .*[Kk]ernel size"),
        ("nowhere:cnn", (64, 64, 3), "algorithm.encoder: 'nowhere:cnn' cannot be imported"),
    ],
)
def test_an_encoder_that_cannot_read_the_observation_is_refused(name, shape, says):
    with pytest.raises(ConfigError, match=says):
        make_encoder(PPOConfig(encoder=name), shape)


@pytest.mark.parametrize(("shape", "stack"), [((64, 64, 6), 2), ((64, 64, 4), 4), ((41, 67, 3), 1)])
def test_keypoints_are_what_plain_convolutions_and_a_softmax_give(shape, stack):
    """The first layer reads squares of pixels, and the points come with derivatives of their own: both are only faster."""
    whole = encoder("keypoints", shape=shape)
    trunk = whole.trunk
    frames = torch.randint(256, (5, *shape), generator=torch.Generator().manual_seed(0), dtype=torch.uint8)
    each = frames.unflatten(-1, (stack, -1)).permute(0, 3, 4, 1, 2).flatten(0, 1).float()
    answers = trunk.second(trunk.first(each).relu()) * trunk.sharpness[:, None, None]
    points = (answers.flatten(2).softmax(-1) @ trunk.places[:, :2]).transpose(1, 2).unflatten(0, (5, stack))
    moved = 5.0 * points.diff(dim=1)
    expected, found = trunk.dense(torch.cat([points[:, -1:], moved], 1).flatten(1)), whole(frames)
    torch.testing.assert_close(found, expected, atol=1e-5, rtol=1e-4)
    pull = torch.randn(found.shape, generator=torch.Generator().manual_seed(1))
    weights = list(whole.parameters())
    ours, theirs = (torch.autograd.grad((x * pull).sum(), weights) for x in (found, expected))
    largest = max(float(one.abs().max()) for one in theirs)  # that of the second layer's biases is 0 but for rounding
    for a, b in zip(ours, theirs, strict=True):
        torch.testing.assert_close(a, b, atol=1e-5 * largest, rtol=1e-3)


def test_derivatives_of_the_soft_argmax_are_right():
    rng = torch.Generator().manual_seed(0)
    answers = torch.randn(2, 9, 4, generator=rng, dtype=torch.float64, requires_grad=True)
    places = torch.cat([torch.randn(9, 2, generator=rng, dtype=torch.float64), torch.ones(9, 1)], 1)
    assert torch.autograd.gradcheck(lambda x: SoftArgmax.apply(x, places), (answers,))


def test_squares_are_the_same_on_every_device():
    frames = torch.randint(256, (5, 41, 67, 3), generator=torch.Generator().manual_seed(0), dtype=torch.uint8)
    assert torch.equal(encoder("keypoints").trunk.squares(frames), squares_by_torch(frames))


def rollout_of(stack, steps=9, num_envs=3, seed=0):
    """Stacks of random frames [T, N, ...] in which episodes begin now and then, and with which steps they end."""
    rng = torch.Generator().manual_seed(seed)
    done = torch.rand(steps, num_envs, 1, generator=rng) < 0.3
    frames = torch.randint(256, (steps + stack, num_envs, 64, 64, 3), generator=rng, dtype=torch.uint8)
    now = torch.cat(list(frames[:stack]), -1)
    stacks = []
    for t in range(steps):
        stacks.append(now)
        newest = frames[stack + t]
        now = torch.where(
            done[t, :, :, None, None], newest.repeat(1, 1, 1, stack), torch.cat([now[..., 3:], newest], -1)
        )
    return torch.stack(stacks), done


@pytest.mark.parametrize("stack", [1, 2, 4])
def test_stacks_of_rollouts_are_read_alike_by_the_places_of_their_frames_in_the_same_memory(stack):
    whole, pools = encoder("keypoints", shape=(64, 64, 3 * stack)), set()
    for seed in (0, 1):
        frames, done = rollout_of(stack, seed=seed)
        assert are_stacks_by_torch(frames, done[..., 0], stack)
        places = whole.prepare(frames, done)
        assert places.shape == (9, 3, stack) and len(whole.pool) == (9 + stack - 1) * 3
        torch.testing.assert_close(whole(places), whole(frames), atol=1e-5, rtol=1e-4)
        torch.testing.assert_close(whole(places[2:4, 1]), whole(frames[2:4, 1]), atol=1e-5, rtol=1e-4)
        pools.add(whole.pool.data_ptr())
    assert len(pools) == 1


@pytest.mark.parametrize("where", ["within an episode", "at its beginning"])
def test_what_is_no_stack_of_successive_frames_is_read_as_it_is(where):
    whole = encoder("keypoints", shape=(64, 64, 6))
    frames, done = rollout_of(2)
    t, n = next((t, n) for t in range(8) for n in range(3) if bool(done[t, n, 0]) == (where == "at its beginning"))
    frames[t + 1, n, 5, 6, 1] ^= 1
    assert not are_stacks_by_torch(frames, done[..., 0], 2)
    places = whole.prepare(frames, done)
    assert len(whole.pool) == 9 * 3 * 2
    torch.testing.assert_close(whole(places), whole(frames), atol=1e-5, rtol=1e-4)


@pytest.mark.parametrize("stack", [1, 2, 4])
def test_while_steps_follow_each_other_no_frame_is_looked_at_twice(stack, monkeypatch):
    whole = encoder("keypoints", shape=(64, 64, 3 * stack))
    frames, done = rollout_of(stack)
    with torch.no_grad():
        expected = [whole(now) for now in frames]
        looked = []
        look = whole.trunk.look
        monkeypatch.setattr(whole.trunk, "look", lambda squares: looked.append(len(squares)) or look(squares))
        with successive(whole):
            found = [whole(now) for now in frames]
    torch.testing.assert_close(found, expected, atol=1e-5, rtol=1e-4)
    begun = done[:-1, :, 0].sum(1).tolist()
    assert looked == [3 * stack, *(3 + (stack - 1) * some for some in begun)]


def test_what_does_not_follow_from_the_last_batch_is_looked_at_anew():
    whole = encoder("keypoints", shape=(64, 64, 6))
    frames, _ = rollout_of(2)
    batches = [frames[0], frames[3], frames[1, :2], frames[2, 1:], frames[2], frames[3].flip(0)]
    with torch.no_grad(), successive(nn.Sequential(whole)):
        found = [whole(batch) for batch in batches]
    torch.testing.assert_close(found, [whole(batch) for batch in batches], atol=1e-5, rtol=1e-4)


def test_what_was_seen_is_forgotten_with_the_weights_that_saw_it():
    whole = encoder("keypoints", shape=(64, 64, 6))
    frames, _ = rollout_of(2)
    with torch.no_grad():
        with pytest.raises(KeyError), successive(whole):
            whole(frames[0])
            raise KeyError
        whole.trunk.second.weight.mul_(-1)
        with successive(whole):
            found = whole(frames[0])
        torch.testing.assert_close(found, whole(frames[0]), atol=1e-5, rtol=1e-4)


def test_gradients_reach_the_older_frames_while_steps_follow_each_other():
    whole = encoder("keypoints", shape=(64, 64, 6))
    frames, _ = rollout_of(2)
    whole(frames[1]).sum().backward()
    expected = whole.trunk.first.weight.grad.clone()
    whole.zero_grad()
    with successive(whole):
        with torch.no_grad():
            whole(frames[0])
        whole(frames[1]).sum().backward()
    torch.testing.assert_close(whole.trunk.first.weight.grad, expected)


@pytest.mark.parametrize("name", ["small", "mlp"])
def test_other_encoders_read_a_rollout_as_it_is(name):
    one = MLP(6, (8,)) if name == "mlp" else encoder(name, shape=(64, 64, 6))
    frames, done = rollout_of(2)
    assert one.prepare(frames, done) is frames
