"""Augmentations: each image is changed by its own draw, and keeps its content."""

import pytest
import torch

from experiments.networks.augmentations import random_crop, random_intensity, random_shift, windows_by_index


def generator(seed=0):
    return torch.Generator().manual_seed(seed)


def noise(n, height=64, width=64):
    return torch.randint(0, 256, (n, height, width, 3), dtype=torch.uint8, generator=generator(1))


def shift_of(shifted, frame, pixels):
    """By how much the frame was moved (rows, columns), found by its inner part."""
    height, width, _ = frame.shape
    inner = frame[pixels : height - pixels, pixels : width - pixels]
    for row in range(2 * pixels + 1):
        for column in range(2 * pixels + 1):
            window = shifted[row : row + height - 2 * pixels, column : column + width - 2 * pixels]
            if torch.equal(window, inner):
                return row - pixels, column - pixels
    raise AssertionError("the content of the frame is not in it any more")


def test_each_image_is_shifted_by_its_own_draw_and_keeps_its_content():
    frames = noise(200, 20, 24)
    shifts = [shift_of(a, b, 3) for a, b in zip(random_shift(frames, 3, generator()), frames, strict=True)]
    assert {row for row, _ in shifts} == {column for _, column in shifts} == set(range(-3, 4))
    assert len(set(shifts)) > 40  # of 49


def test_what_a_shift_uncovers_repeats_the_border():
    frame = noise(1, 8, 8)
    for seed in range(20):
        shifted = random_shift(frame, 2, generator(seed))
        row, column = shift_of(shifted[0], frame[0], 2)
        rows = (torch.arange(8) - row).clamp(0, 7)
        columns = (torch.arange(8) - column).clamp(0, 7)
        assert torch.equal(shifted[0], frame[0][rows][:, columns])


def test_equal_images_look_different_after_a_shift_and_one_shift_of_none_changes_nothing():
    frames = noise(1).expand(16, -1, -1, -1)
    shifted = random_shift(frames, 4, generator())
    assert len({tuple(image.flatten().tolist()) for image in shifted}) > 10
    assert torch.equal(random_shift(frames, 0, generator()), frames)


def test_a_crop_is_a_window_of_the_frame_enlarged_to_its_size():
    """On a frame whose values grow by 3 per column, the window's place can be read off, and its slope is 3 x share."""
    ramp = (3 * torch.arange(64)).to(torch.uint8).expand(64, 64)[None, :, :, None].expand(40, -1, -1, 3)
    cropped = random_crop(ramp, 0.8, generator())
    assert cropped.shape == ramp.shape and cropped.dtype == torch.uint8
    inner = cropped[:, 32, 8:56, 0].float()
    slopes = (inner[:, -1] - inner[:, 0]) / 47
    torch.testing.assert_close(slopes, torch.full((40,), 3 * 51 / 64), atol=0.03, rtol=0)
    firsts = cropped[:, 32, 0, 0]
    assert len(firsts.unique()) > 7  # of 14 places
    assert firsts.max() <= 3 * 13


def test_a_crop_of_everything_is_the_frame():
    frames = noise(3)
    assert torch.equal(random_crop(frames, 1.0, generator()), frames)


def test_brightness_changes_by_one_factor_per_image():
    frames = torch.full((500, 4, 4, 3), 100, dtype=torch.uint8)
    changed = random_intensity(frames, 0.05, generator())
    assert torch.equal(changed, changed[:, :1, :1, :1].expand_as(changed))
    factors = changed[:, 0, 0, 0].float() / 100
    assert 0.9 <= factors.min() < 0.95 and 1.05 < factors.max() <= 1.1  # clipped at two deviations
    assert factors.std() == pytest.approx(0.05 * 0.88, rel=0.1)  # a normal law clipped at 2 has deviation 0.88
    white = torch.full((50, 2, 2, 3), 255, dtype=torch.uint8)
    assert random_intensity(white, 0.05, generator()).min() > 200  # nothing wraps around


@pytest.mark.parametrize("change", [lambda f, g: random_shift(f, 4, g), lambda f, g: random_crop(f, 0.8, g),
                                    lambda f, g: random_intensity(f, 0.05, g)])  # fmt: skip
def test_the_generator_decides_everything(change):
    frames = noise(6)
    before = frames.clone()
    assert torch.equal(change(frames, generator(3)), change(frames, generator(3)))
    assert not torch.equal(change(frames, generator(3)), change(frames, generator(4)))
    assert torch.equal(frames, before)


def test_windows_are_the_same_by_index_and_by_copying():
    frames = noise(30, 20, 24)
    corners = torch.randint(5, (30, 2), generator=generator())
    copied = torch.stack([f[r : r + 16, c : c + 18] for f, (r, c) in zip(frames, corners.tolist(), strict=True)])
    assert torch.equal(windows_by_index(frames, corners, 16, 18), copied)
