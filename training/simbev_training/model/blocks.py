"""Building blocks of all networks: convolutions with batch normalization, and residual blocks."""

from collections.abc import Sequence

from torch import Tensor, nn


def conv_norm_relu(
    channels_in: int, channels_out: int, kernel: int = 3, stride: int = 1, dilation: int = 1, padding: int | None = None
) -> nn.Sequential:
    """Convolution, batch normalization, ReLU; padding None: the size stays at stride 1."""
    padding = dilation * (kernel - 1) // 2 if padding is None else padding
    return nn.Sequential(
        nn.Conv2d(channels_in, channels_out, kernel, stride, padding, dilation, bias=False),
        nn.BatchNorm2d(channels_out),
        nn.ReLU(inplace=True),
    )


class ResidualBlock(nn.Module):
    """Basic block of a ResNet (https://arxiv.org/abs/1512.03385): two 3 x 3 convolutions and a shortcut."""

    def __init__(self, channels_in: int, channels_out: int, stride: int = 1, dilation: int = 1) -> None:
        super().__init__()
        self.first = conv_norm_relu(channels_in, channels_out, 3, stride, dilation)
        self.second = nn.Sequential(
            nn.Conv2d(channels_out, channels_out, 3, padding=dilation, dilation=dilation, bias=False),
            nn.BatchNorm2d(channels_out),
        )
        self.shortcut: nn.Module = nn.Identity()
        if stride != 1 or channels_in != channels_out:
            self.shortcut = nn.Sequential(
                nn.Conv2d(channels_in, channels_out, 1, stride, bias=False), nn.BatchNorm2d(channels_out)
            )
        self.relu = nn.ReLU(inplace=True)

    def forward(self, features: Tensor) -> Tensor:
        """(B, C, H, W) to (B, C', H / stride, W / stride)."""
        result: Tensor = self.relu(self.second(self.first(features)) + self.shortcut(features))
        return result


def residual_stage(
    channels_in: int, channels_out: int, blocks: int, stride: int, dilations: Sequence[int] = ()
) -> nn.Sequential:
    """Residual blocks, of which the first has the stride, followed by one for each dilation."""
    rest = [ResidualBlock(channels_out, channels_out) for _ in range(blocks - 1)]
    wide = [ResidualBlock(channels_out, channels_out, dilation=each) for each in dilations]
    return nn.Sequential(ResidualBlock(channels_in, channels_out, stride), *rest, *wide)
