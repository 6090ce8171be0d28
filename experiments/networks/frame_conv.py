"""The first layer of a CNN that reads frames as they are."""

from torch import Tensor, nn

WHITE = 255.0  # the brightest value of a frame


class FrameConv(nn.Conv2d):
    """A convolution of numbers from 0 to 255 that computes what another one would of numbers from 0 to 1.

    It divides its weights instead of the pixels, which are many more, and exact in bfloat16 as they are.
    """

    @property
    def divided_weight(self) -> Tensor:
        """The weight for numbers from 0 to 255."""
        return self.weight * (1.0 / WHITE)

    def forward(self, input: Tensor) -> Tensor:  # torch's name
        """As :class:`torch.nn.Conv2d`."""
        return self._conv_forward(input, self.divided_weight, self.bias)
