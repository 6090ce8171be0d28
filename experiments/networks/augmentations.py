"""Random changes of frames that keep their content; every frame gets a random change of its own.

All take and return frames uint8 ``[n, height, width, depth]``, channels last, and draw from ``rng``, a generator of the
processor whatever the device of the frames, so that runs on different devices see the same changes. They work on bytes: a
copy of a window costs a tenth of an interpolation of floats. A depth that is a multiple of 3 is a stack of frames in colour,
any other depth a stack of grey frames; all frames of a stack get the same change.
"""

import math

import torch
from torch import Tensor
from torch.nn import functional as F

LUMA = (0.299, 0.587, 0.114)  # weights of red, green and blue in what the eye takes for brightness (ITU-R BT.601)
BOX = (7 / 64, 21 / 64)  # sides of a cut-out box, in sides of a frame (Raileanu et al. 2021)
JITTER = 0.4  # by which factors of colours differ from 1 at most (Raileanu et al. 2021)


def random_shift(frames: Tensor, pixels: int, rng: torch.Generator) -> Tensor:
    """Each frame moved by up to ``pixels`` in each direction; its border is repeated outwards (Yarats et al. 2020)."""
    n, height, width, _ = frames.shape
    corners = torch.randint(2 * pixels + 1, (n, 2), generator=rng)
    return _windows(_widened(frames, pixels), corners, height, width)


def random_crop(frames: Tensor, share: float, rng: torch.Generator) -> Tensor:
    """A window of ``share`` of each frame's sides, anywhere in it, enlarged to the frame's size (bilinearly)."""
    n, height, width, _ = frames.shape
    size = (round(share * height), round(share * width))
    room = torch.tensor([height - size[0] + 1, width - size[1] + 1])
    corners = (torch.rand(n, 2, generator=rng) * room).long()
    windows = _windows(frames, corners, *size).permute(0, 3, 1, 2)
    enlarged = F.interpolate(windows.float(), (height, width), mode="bilinear", align_corners=False)
    return enlarged.round_().to(torch.uint8).permute(0, 2, 3, 1).contiguous()


def random_intensity(frames: Tensor, deviation: float, rng: torch.Generator) -> Tensor:
    """Each frame's brightness times 1 + ``deviation`` z, with z a normal draw clipped to [-2, 2] (Schwarzer et al. 2020)."""
    z = torch.randn(len(frames), 1, 1, 1, generator=rng).clamp_(-2.0, 2.0)
    factor = (1.0 + deviation * z).to(frames.device)
    return (frames * factor).round_().clamp_(0.0, 255.0).to(torch.uint8)


def random_cutout(frames: Tensor, coloured: bool, rng: torch.Generator) -> Tensor:
    """A box somewhere in each frame, whose sides are :data:`BOX` of the frame's, painted black, or in a random colour."""
    n, height, width, depth = frames.shape
    inside = torch.ones(n, height, width, dtype=torch.bool)
    for axis, side in ((1, height), (2, width)):
        low, high = (round(share * side) for share in BOX)
        sizes = torch.randint(low, high + 1, (n, 1), generator=rng)
        first = (torch.rand(n, 1, generator=rng) * (side - sizes + 1)).long()
        places = torch.arange(side)
        inside &= ((places >= first) & (places < first + sizes)).unsqueeze(3 - axis)
    colour = torch.zeros(n, 1, 1, depth, dtype=torch.uint8)
    if coloured:
        channels = _channels(frames)
        drawn = torch.randint(256, (n, 1, 1, channels), dtype=torch.uint8, generator=rng)
        colour = drawn.repeat(1, 1, 1, depth // channels)
    return torch.where(inside[..., None].to(frames.device), colour.to(frames.device), frames)


def random_flip(frames: Tensor, rng: torch.Generator) -> Tensor:
    """Each frame upside down, or as it was, with equal probability."""
    flipped = torch.randint(2, (len(frames), 1, 1, 1), generator=rng).bool()
    return torch.where(flipped.to(frames.device), frames.flip(1), frames)


def random_rotation(frames: Tensor, rng: torch.Generator) -> Tensor:
    """Each frame, which is square, turned by 0, 90, 180 or 270 degrees, with equal probability."""
    quarters = torch.randint(4, (len(frames),), generator=rng).to(frames.device)
    turned = torch.empty_like(frames)
    for quarter in range(4):
        chosen = quarters == quarter
        turned[chosen] = frames[chosen].rot90(quarter, (1, 2))
    return turned


def greyscale(frames: Tensor) -> Tensor:
    """Frames without colours: the three channels of each are its :data:`LUMA`. Grey frames stay what they are."""
    if _channels(frames) == 1:
        return frames
    coloured = frames.unflatten(-1, (-1, 3)).float()
    grey = (coloured @ torch.tensor(LUMA, device=frames.device)).round_().to(torch.uint8)
    return grey.unsqueeze(-1).expand(coloured.shape).flatten(-2)


def random_colour_jitter(frames: Tensor, rng: torch.Generator) -> Tensor:
    """Brightness, contrast and saturation of each frame times factors between 0.6 and 1.4, and hues turned by one angle.

    All four are affine maps of colours, so each frame is changed by one matrix and one vector. Hues turn around the axis of
    greys, at constant :data:`LUMA`. Contrast is about the mean colour of the frame.
    """
    n, channels = len(frames), _channels(frames)
    brightness, contrast, saturation = (1.0 + JITTER * (2.0 * torch.rand(3, n, 1, 1, generator=rng) - 1.0)).unbind()
    angle = torch.pi * (2.0 * torch.rand(n, generator=rng) - 1.0)
    matrix = brightness.expand(n, channels, channels) * torch.eye(channels)
    if channels == 3:
        grey = torch.tensor(LUMA).expand(3, 3)
        matrix = matrix @ (saturation * torch.eye(3) + (1.0 - saturation) * grey) @ _hue_matrix(angle)
    matrix, contrast = matrix.to(frames.device), contrast.to(frames.device)
    colours = frames.reshape(n, -1, channels).float()
    middle = colours.mean(1, keepdim=True) @ matrix.mT
    return _bytes(torch.baddbmm((1.0 - contrast) * middle, colours, (contrast * matrix).mT)).view(frames.shape)


def random_convolution(frames: Tensor, rng: torch.Generator) -> Tensor:
    """Each frame by a 3x3 convolution of its own with normal weights (Lee et al. 2020), its result spread over 0 to 255."""
    n, height, width, depth = frames.shape
    channels = _channels(frames)
    deviation = math.sqrt(2.0 / (2 * 9 * channels))  # Glorot's, as 9 inputs of each channel make 9 outputs of each
    weights = deviation * torch.randn(n * channels, channels, 3, 3, generator=rng)
    # The convolutions of all frames are the groups of one convolution, of which a stack's frames are the batch.
    x = frames.unflatten(-1, (-1, channels)).permute(3, 0, 4, 1, 2).reshape(-1, n * channels, height, width)
    made = F.conv2d(x.float(), weights.to(frames.device), padding=1, groups=n).unflatten(1, (n, channels))
    low, high = made.amin((0, 2, 3, 4), keepdim=True), made.amax((0, 2, 3, 4), keepdim=True)
    made = (made - low) * (255.0 / (high - low).clamp_(min=1.0))
    return _bytes(made).permute(1, 3, 4, 0, 2).reshape(n, height, width, depth)


def _channels(frames: Tensor) -> int:
    """Of one frame of a stack: 3 in colour, 1 in grey."""
    return 3 if frames.shape[-1] % 3 == 0 else 1


def _bytes(numbers: Tensor) -> Tensor:
    """Numbers, which are overwritten, as bytes."""
    return numbers.round_().clamp_(0.0, 255.0).to(torch.uint8)


def _hue_matrix(angle: Tensor) -> Tensor:
    """Matrices [n, 3, 3] that turn the hues of red, green and blue by angles [n], and keep greys and luma."""
    # A colour is its luma and how much more red and blue it has than that; the two differences turn like a vector.
    red, green, blue = LUMA
    to_differences = torch.tensor([LUMA, (1.0 - red, -green, -blue), (-red, -green, 1.0 - blue)])
    back = torch.tensor([(1.0, 1.0, 0.0), (1.0, -red / green, -blue / green), (1.0, 0.0, 1.0)])
    turn = torch.zeros(len(angle), 3, 3)
    turn[:, 0, 0] = 1.0
    turn[:, 1, 1] = turn[:, 2, 2] = angle.cos()
    turn[:, 1, 2], turn[:, 2, 1] = -angle.sin(), angle.sin()
    return back @ turn @ to_differences


def _widened(frames: Tensor, pixels: int) -> Tensor:
    """Frames with their borders repeated ``pixels`` times on all sides."""
    for side in (1, 2):  # joining slices takes a tenth of the time of indexing
        first, last = frames.narrow(side, 0, 1), frames.narrow(side, -1, 1)
        shape = list(frames.shape)
        shape[side] = pixels
        frames = torch.cat([first.expand(shape), frames, last.expand(shape)], side)
    return frames


def _windows(frames: Tensor, corners: Tensor, height: int, width: int) -> Tensor:
    """The window of each frame whose first row and column are ``corners`` (int [n, 2])."""
    if frames.device.type != "cpu":
        return windows_by_index(frames, corners.to(frames.device), height, width)
    windows = frames.new_empty(len(frames), height, width, frames.shape[-1])
    for window, frame, (row, column) in zip(windows, frames, corners.tolist(), strict=True):
        window.copy_(frame[row : row + height, column : column + width])
    return windows


def windows_by_index(frames: Tensor, corners: Tensor, height: int, width: int) -> Tensor:
    """The windows, without a loop over frames: better on an accelerator, and fifteen times slower on a processor."""
    image = torch.arange(len(frames), device=frames.device)[:, None, None]
    rows = corners[:, :1] + torch.arange(height, device=frames.device)
    columns = corners[:, 1:] + torch.arange(width, device=frames.device)
    return frames[image, rows[:, :, None], columns[:, None, :]]
