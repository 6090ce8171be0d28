"""Augmentations: each image is changed by its own draw, and keeps its content."""

import pytest
import torch

from segar.experiments.networks.augmentations import (
    LUMA,
    greyscale,
    random_colour_jitter,
    random_convolution,
    random_crop,
    random_cutout,
    random_flip,
    random_intensity,
    random_rotation,
    random_shift,
    windows_by_index,
)

RANDOM = {
    "cutout": lambda f, g: random_cutout(f, False, g),
    "cutout_colour": lambda f, g: random_cutout(f, True, g),
    "flip": random_flip,
    "rotation": random_rotation,
    "colour_jitter": random_colour_jitter,
    "convolution": random_convolution,
}


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


def test_a_crop_of_everything_and_a_shift_of_nothing_are_the_frame():
    frames = noise(3)
    assert torch.equal(random_crop(frames, 1.0, generator()), frames)
    assert torch.equal(random_shift(frames, 0, generator()), frames)


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
                                    lambda f, g: random_intensity(f, 0.05, g), *RANDOM.values()])  # fmt: skip
@pytest.mark.parametrize("depth", [1, 3])
def test_the_generator_decides_everything_of_grey_and_coloured_frames(change, depth):
    frames = noise(6)[..., :depth]
    before = frames.clone()
    changed = change(frames, generator(3))
    assert changed.shape == frames.shape and changed.dtype == torch.uint8
    assert torch.equal(changed, change(frames, generator(3)))
    assert not torch.equal(changed, change(frames, generator(4)))
    assert torch.equal(frames, before)


def test_windows_are_the_same_by_index_and_by_copying():
    frames = noise(30, 20, 24)
    corners = torch.randint(5, (30, 2), generator=generator())
    copied = torch.stack([f[r : r + 16, c : c + 18] for f, (r, c) in zip(frames, corners.tolist(), strict=True)])
    assert torch.equal(windows_by_index(frames, corners, 16, 18), copied)


@pytest.mark.parametrize("name", RANDOM)
def test_all_frames_of_a_stack_get_the_same_change(name):
    frame = noise(12)
    stack = RANDOM[name](torch.cat([frame, frame], -1), generator())
    assert stack.shape == (12, 64, 64, 6) and stack.dtype == torch.uint8
    first, second = stack.split(3, -1)
    assert (first.int() - second.int()).abs().max() <= 1  # matrices are multiplied in another order
    assert len({tuple(image.flatten().tolist()) for image in first}) == 12


@pytest.mark.parametrize("coloured", [False, True])
def test_a_cutout_is_one_box_of_one_colour_somewhere_in_the_frame(coloured):
    frames = torch.full((300, 64, 64, 3), 77, dtype=torch.uint8)
    cut = random_cutout(frames, coloured, generator())
    boxes = (cut != 77).any(-1)
    corners, sides, colours = set(), set(), set()
    for frame, box in zip(cut, boxes, strict=True):
        rows, columns = box.any(1).nonzero().flatten(), box.any(0).nonzero().flatten()
        assert box.sum() == len(rows) * len(columns)
        corners.add((int(rows[0]), int(columns[0])))
        sides |= {len(rows), len(columns)}
        colours |= {tuple(colour.tolist()) for colour in frame[box]}
    assert min(sides) == 7 and max(sides) == 21 and len(corners) > 250
    assert max(row for row, _ in corners) > 45 and min(row for row, _ in corners) == 0
    assert (len(colours) > 290) if coloured else (colours == {(0, 0, 0)})


def test_frames_are_flipped_and_rotated_as_often_as_not():
    frames = noise(400)
    flipped = random_flip(frames, generator())
    same = (flipped == frames).flatten(1).all(1)
    assert torch.equal(flipped[~same], frames[~same].flip(1)) and 160 < same.sum() < 240
    turned = random_rotation(frames, generator())
    counts = [(turned == frames.rot90(quarter, (1, 2))).flatten(1).all(1).sum().item() for quarter in range(4)]
    assert sum(counts) == 400 and min(counts) > 70


def test_greyscale_keeps_the_luma_and_nothing_else():
    frames = noise(5)
    grey = greyscale(frames)
    assert torch.equal(grey[..., 0], grey[..., 1]) and torch.equal(grey[..., 0], grey[..., 2])
    expected = (frames.double() @ torch.tensor(LUMA).double()).round()
    assert (grey[..., 0] - expected).abs().max() <= 1
    assert torch.equal(greyscale(grey), grey)
    assert torch.equal(greyscale(frames[..., :1]), frames[..., :1])


def test_jitter_keeps_greys_grey_and_turns_other_hues_at_constant_luma_times_brightness():
    grey = random_colour_jitter(torch.full((200, 2, 2, 3), 120, dtype=torch.uint8), generator())
    assert torch.equal(grey, grey[..., :1].expand_as(grey))
    assert 0.6 * 120 <= grey.min() < 80 and 160 < grey.max() <= 1.4 * 120
    colour = torch.tensor([140, 90, 100], dtype=torch.uint8).expand(600, 2, 2, 3)
    changed = random_colour_jitter(colour, generator())[:, 0, 0].double()
    brightness = changed @ torch.tensor(LUMA).double() / (colour[0, 0, 0].double() @ torch.tensor(LUMA).double())
    assert brightness.min() > 0.59 and brightness.max() < 1.41
    assert brightness.mean() == pytest.approx(1.0, abs=0.03)
    largest = changed.argmax(-1)
    assert all((largest == channel).double().mean() > 0.2 for channel in range(3))


def test_jitter_scales_contrast_about_the_mean_of_the_frame():
    frames = torch.full((300, 2, 2, 3), 90, dtype=torch.uint8)
    frames[:, 1] = 110
    changed = random_colour_jitter(frames, generator()).double()
    mean, contrast = changed.mean((1, 2, 3)) / 100, (changed[:, 1, 0, 0] - changed[:, 0, 0, 0]) / 20
    assert 0.59 < mean.min() < 0.65 and 1.35 < mean.max() < 1.41
    factors = contrast / mean  # of contrast alone
    assert 0.5 < factors.min() < 0.7 and 1.3 < factors.max() < 1.5


def test_a_random_convolution_keeps_where_things_are_and_changes_how_they_look():
    frames = torch.full((50, 32, 32, 3), 40, dtype=torch.uint8)
    frames[:, 10:20, 5:12] = torch.tensor([200, 60, 120], dtype=torch.uint8)
    changed = random_convolution(frames, generator())
    assert (changed.flatten(1).amax(1) == 255).all() and (changed.flatten(1).amin(1) == 0).all()
    inner = changed[:, 11:19, 6:11].flatten(1, 2)
    ground = changed[:, 22:30, 15:30].flatten(1, 2)
    for part in (inner, ground):
        assert torch.equal(part, part[:, :1].expand_as(part))
    assert ((inner[:, 0].int() - ground[:, 0].int()).abs().amax(-1) > 10).double().mean() > 0.9
    assert len({tuple(colour.tolist()) for colour in inner[:, 0]}) > 45
