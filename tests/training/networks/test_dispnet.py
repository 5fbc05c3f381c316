"""DispNetCorr1D as built, against the published layer table."""

from collections.abc import Iterator

import pytest
import torch
from torch import nn

from training.networks import DispNetConfig, DispNetCorr1D
from training.networks.regressors.dispnet import LEAKY_SLOPE

HEIGHT, WIDTH = 64, 128
LINEAR, LEAKY = "none", "LReLU"

# name: kernel, stride, in, out, activation, denominator of the output's resolution, trained bias
TABLE = {
    "conv1": (7, 2, 3, 64, LEAKY, 2, True),
    "conv2": (5, 2, 64, 128, LEAKY, 4, True),
    "conv_redir": (1, 1, 128, 64, LEAKY, 4, True),
    "conv3": (5, 2, 145, 256, LEAKY, 8, True),
    "conv3_1": (3, 1, 256, 256, LEAKY, 8, True),
    "conv4": (3, 2, 256, 512, LEAKY, 16, True),
    "conv4_1": (3, 1, 512, 512, LEAKY, 16, True),
    "conv5": (3, 2, 512, 512, LEAKY, 32, True),
    "conv5_1": (3, 1, 512, 512, LEAKY, 32, True),
    "conv6": (3, 2, 512, 1024, LEAKY, 64, True),
    "conv6_1": (3, 1, 1024, 1024, LEAKY, 64, True),
    "pr6": (3, 1, 1024, 1, LINEAR, 64, True),
    "stage5.upconv": (4, 2, 1024, 512, LEAKY, 32, False),
    "stage5.uppr": (4, 2, 1, 1, LINEAR, 32, False),
    "stage5.iconv": (3, 1, 1025, 512, LINEAR, 32, True),
    "stage5.pr": (3, 1, 512, 1, LINEAR, 32, True),
    "stage4.upconv": (4, 2, 512, 256, LEAKY, 16, False),
    "stage4.uppr": (4, 2, 1, 1, LINEAR, 16, False),
    "stage4.iconv": (3, 1, 769, 256, LINEAR, 16, True),
    "stage4.pr": (3, 1, 256, 1, LINEAR, 16, True),
    "stage3.upconv": (4, 2, 256, 128, LEAKY, 8, False),
    "stage3.uppr": (4, 2, 1, 1, LINEAR, 8, False),
    "stage3.iconv": (3, 1, 385, 128, LINEAR, 8, True),
    "stage3.pr": (3, 1, 128, 1, LINEAR, 8, True),
    "stage2.upconv": (4, 2, 128, 64, LEAKY, 4, False),
    "stage2.uppr": (4, 2, 1, 1, LINEAR, 4, False),
    "stage2.iconv": (3, 1, 193, 64, LINEAR, 4, True),
    "stage2.pr": (3, 1, 64, 1, LINEAR, 4, True),
    "stage1.upconv": (4, 2, 64, 32, LEAKY, 2, False),
    "stage1.uppr": (4, 2, 1, 1, LINEAR, 2, False),
    "stage1.iconv": (3, 1, 97, 32, LINEAR, 2, True),
    "stage1.pr": (3, 1, 32, 1, LINEAR, 2, True),
}


@pytest.fixture(scope="module")
def network() -> DispNetCorr1D:
    torch.manual_seed(0)
    return DispNetCorr1D()


def convolutions(network: nn.Module) -> Iterator[tuple[str, nn.Conv2d | nn.ConvTranspose2d, str]]:
    """(name, convolution, activation after it), the network's own containers looked into."""
    modules = dict(network.named_modules())
    for name, module in modules.items():
        if isinstance(module, nn.Conv2d | nn.ConvTranspose2d):
            parent, _, index = name.rpartition(".")
            if isinstance(modules[parent], nn.Sequential):
                after = list(modules[parent])[int(index) + 1 :]
                assert all(isinstance(layer, nn.LeakyReLU) and layer.negative_slope == 0.1 for layer in after)
                yield parent, module, LEAKY if after else LINEAR
            else:
                yield name, module, LINEAR


def test_layer_table(network: DispNetCorr1D) -> None:
    assert LEAKY_SLOPE == 0.1
    sizes: dict[nn.Module, torch.Size] = {}
    hooks = [
        layer.register_forward_hook(lambda module, _, output: sizes.__setitem__(module, output.shape))
        for _, layer, _ in convolutions(network)
    ]
    with torch.no_grad():
        output = network(torch.rand(1, 3, HEIGHT, WIDTH), torch.rand(1, 3, HEIGHT, WIDTH))
    for hook in hooks:
        hook.remove()
    found = {}
    for name, layer, activation in convolutions(network):
        denominator = HEIGHT // sizes[layer][2]
        assert sizes[layer][3] == WIDTH // denominator
        kernel, stride = layer.kernel_size[0], layer.stride[0]
        if isinstance(layer, nn.Conv2d):
            assert layer.padding == (kernel // 2, kernel // 2)
        found[name] = (
            kernel,
            stride,
            layer.in_channels,
            layer.out_channels,
            activation,
            denominator,
            layer.bias is not None and layer.bias.requires_grad,
        )
    assert found == TABLE
    assert [d.shape for d in output.disparities] == [
        (1, 1, HEIGHT // s, WIDTH // s) for s in (64, 32, 16, 8, 4, 2)
    ]
    assert output.features.shape == (1, 97, HEIGHT // 2, WIDTH // 2)
    assert network.correlation.out_channels == 81


def test_parameter_counts(network: DispNetCorr1D) -> None:
    parameters = list(network.parameters())
    assert sum(p.numel() for p in parameters) == 42_430_107
    assert sum(p.numel() for p in parameters if p.requires_grad) == 42_429_110
    frozen = [p for p in parameters if not p.requires_grad]
    assert sum(p.numel() for p in frozen) == 997
    assert all((p == 0).all() for p in frozen)


def test_initialization(network: DispNetCorr1D) -> None:
    """MSRA: variance 2 / fan-in; biases zero."""
    for name, layer, _ in convolutions(network):
        fan_in = layer.weight[0].numel()
        if layer.weight.numel() > 5000:
            assert layer.weight.var().item() * fan_in == pytest.approx(2, rel=0.1), name
        assert layer.bias is not None
        assert (layer.bias == 0).all()


def test_decays_the_contracting_weights_only(network: DispNetCorr1D) -> None:
    decayed = {id(p) for p in network.decayed_parameters()}
    names = {name for name, p in network.named_parameters() if id(p) in decayed}
    contracting = [name for name in TABLE if name.startswith("conv")]
    assert names == {f"{name}.0.weight" for name in contracting}


def test_features_are_conv1_upconv1_and_the_upsampled_prediction(network: DispNetCorr1D) -> None:
    torch.manual_seed(2)
    left, right = torch.rand(2, 1, 3, 64, 64)
    with torch.no_grad():
        output = network(left, right)
        conv1 = network.conv1(left - network.image_mean.view(1, 3, 1, 1))
        raw = network.stage1.uppr(output.disparities[4])
    torch.testing.assert_close(output.features[:, :64], conv1)
    torch.testing.assert_close(output.features[:, 96:], raw)
    assert output.decoded.shape[1] == 32
    torch.testing.assert_close(network.stage1.iconv(output.features), output.decoded)


def test_prediction_scale_multiplies_every_prediction() -> None:
    """The scale changes units, nothing else: a network and its scaled twin differ by that factor."""
    config = DispNetConfig(width=0.125)
    torch.manual_seed(3)
    plain = DispNetCorr1D(config).eval()
    scaled = DispNetCorr1D(DispNetConfig(width=0.125, prediction_scale=16.0)).eval()
    scaled.load_state_dict(plain.state_dict())
    left, right = torch.rand(2, 1, 3, 64, 64)
    with torch.no_grad():
        first, second = plain(left, right), scaled(left, right)
    for one, other in zip(first.disparities, second.disparities, strict=True):
        torch.testing.assert_close(other, 16 * one)
    torch.testing.assert_close(second.features[:, :-1], first.features[:, :-1])
    torch.testing.assert_close(second.features[:, -1:], 16 * first.features[:, -1:])


def test_residual_predictions_add_to_the_coarser_one() -> None:
    """With prediction layers of zero, every scale of a residual network repeats the coarsest, upsampled."""
    torch.manual_seed(4)
    network = DispNetCorr1D(DispNetConfig(width=0.125, residual=True)).eval()
    for stage in (network.stage5, network.stage4, network.stage3, network.stage2, network.stage1):
        nn.init.zeros_(stage.pr.weight)
    left, right = torch.rand(2, 1, 3, 128, 128)
    with torch.no_grad():
        coarsest, *finer = network(left, right).disparities
    for disparity in finer:
        expected = nn.functional.interpolate(coarsest, scale_factor=2, mode="bilinear", align_corners=False)
        torch.testing.assert_close(disparity, expected)
        coarsest = expected


def test_small_network_fits_its_size() -> None:
    network = DispNetCorr1D(DispNetConfig(width=0.25, one_sided=True, normalization="batch"))
    assert sum(tensor.numel() for tensor in network.state_dict().values()) * 4 <= 12e6
    assert network.correlation.out_channels == 41
    assert sum(isinstance(layer, nn.BatchNorm2d) for layer in network.modules()) == 11 + 10


def test_refuses_other_sizes(network: DispNetCorr1D) -> None:
    with pytest.raises(ValueError, match="multiple of 64"):
        network(torch.zeros(1, 3, 64, 100), torch.zeros(1, 3, 64, 100))
