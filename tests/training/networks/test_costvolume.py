"""CostVolumeNet as built: its layers, its range, and what it answers for pictures of any size."""

from functools import partial

import pytest
import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn

from training.errors import TrainingError
from training.losses import disparity_smooth_l1, level_cross_entropy
from training.networks import (
    ConfNet,
    CostVolumeConfig,
    CostVolumeNet,
    DispNetConfig,
    DispNetCorr1D,
    GradNet,
)
from training.networks.cost_features import CostFeatures
from training.networks.heads import HeadConfig
from training.networks.inference import crop_inputs, estimate, head_inputs, regress_enlarged
from training.networks.regressors.costvolume import CostVolumeObjective, CostVolumeOutput
from training.networks.regressors.interface import Regression
from training.networks.regressors.registry import find_regressor, known_regressors, regressor_for

HEIGHT, WIDTH = 64, 128
NARROW = CostVolumeConfig(
    stem=4, encoder=(8, 8, 8, 8), aggregation=(4, 4, 4, 4), look_channels=8, full_channels=4
)

# name: kernel, stride, dilation, in, out, denominator of the output's resolution
TABLE = {
    "descriptors.stem.0": (3, 2, 1, 3, 16, 2),
    "descriptors.stem.1": (3, 1, 1, 16, 16, 2),
    "descriptors.down.0.0": (3, 2, 1, 16, 32, 4),
    "descriptors.down.0.1.first": (3, 1, 1, 32, 32, 4),
    "descriptors.down.0.1.second": (3, 1, 1, 32, 32, 4),
    "descriptors.down.1.0": (3, 2, 1, 32, 48, 8),
    "descriptors.down.1.1.first": (3, 1, 1, 48, 48, 8),
    "descriptors.down.1.1.second": (3, 1, 1, 48, 48, 8),
    "descriptors.down.2.0": (3, 2, 1, 48, 64, 16),
    "descriptors.down.2.1.first": (3, 1, 1, 64, 64, 16),
    "descriptors.down.2.1.second": (3, 1, 1, 64, 64, 16),
    "descriptors.down.3.0": (3, 2, 1, 64, 64, 32),
    "descriptors.down.3.1.first": (3, 1, 1, 64, 64, 32),
    "descriptors.down.3.1.second": (3, 1, 1, 64, 64, 32),
    "descriptors.up.2": (3, 1, 1, 128, 64, 16),
    "descriptors.up.1": (3, 1, 1, 112, 48, 8),
    "descriptors.up.0": (3, 1, 1, 80, 32, 4),
    "descriptors.describe_quarter": (1, 1, 1, 32, 32, 4),
    "descriptors.context": (3, 1, 1, 48, 24, 2),
    "descriptors.describe_half": (1, 1, 1, 24, 16, 2),
    "aggregation.enter.0": (3, 1, 1, 4, 8, 4),
    "aggregation.enter.1.0": (3, 2, 1, 8, 16, 8),
    "aggregation.enter.1.1": (3, 1, 1, 16, 16, 8),
    "aggregation.enter.2.0": (3, 2, 1, 16, 32, 16),
    "aggregation.enter.2.1": (3, 1, 1, 32, 32, 16),
    "aggregation.enter.3.0": (3, 2, 1, 32, 32, 32),
    "aggregation.enter.3.1": (3, 1, 1, 32, 32, 32),
    "aggregation.gate.0": (1, 1, 1, 32, 8, 4),
    "aggregation.gate.1": (1, 1, 1, 48, 16, 8),
    "aggregation.gate.2": (1, 1, 1, 64, 32, 16),
    "aggregation.gate.3": (1, 1, 1, 64, 32, 32),
    "aggregation.narrow.2": (1, 1, 1, 32, 32, 32),
    "aggregation.leave.2": (3, 1, 1, 32, 32, 16),
    "aggregation.narrow.1": (1, 1, 1, 32, 16, 16),
    "aggregation.leave.1": (3, 1, 1, 16, 16, 8),
    "aggregation.narrow.0": (1, 1, 1, 16, 8, 8),
    "aggregation.leave.0": (3, 1, 1, 8, 8, 4),
    "aggregation.score": (1, 1, 1, 8, 1, 4),
    "half_weights.0": (3, 1, 1, 32, 32, 4),
    "half_weights.1": (1, 1, 1, 32, 36, 4),
    "look.layers.0": (3, 1, 1, 58, 32, 2),
    "look.layers.1.first": (3, 1, 1, 32, 32, 2),
    "look.layers.1.second": (3, 1, 1, 32, 32, 2),
    "look.layers.2": (3, 1, 2, 32, 32, 2),
    "look.layers.3.first": (3, 1, 1, 32, 32, 2),
    "look.layers.3.second": (3, 1, 1, 32, 32, 2),
    "look.layers.4": (3, 1, 4, 32, 32, 2),
    "look.layers.5.first": (3, 1, 1, 32, 32, 2),
    "look.layers.5.second": (3, 1, 1, 32, 32, 2),
    "look.decide": (3, 1, 1, 32, 8, 2),
    "look.weights.0": (3, 1, 1, 24, 32, 2),
    "look.weights.1": (1, 1, 1, 32, 36, 2),
    "full_look.narrow": (1, 1, 1, 24, 16, 2),
    "full_look.stem": (3, 1, 1, 3, 16, 1),
    "full_look.join": (3, 1, 1, 16, 16, 1),
    "full_look.describe": (1, 1, 1, 16, 8, 1),
    "full_look.layers.0": (3, 1, 1, 30, 16, 1),
    "full_look.layers.1.first": (3, 1, 1, 16, 16, 1),
    "full_look.layers.1.second": (3, 1, 1, 16, 16, 1),
    "full_look.layers.2": (3, 1, 2, 16, 16, 1),
    "full_look.decide": (3, 1, 1, 16, 6, 1),
}


def test_the_layers_are_those_of_the_table() -> None:
    """Read off the running network: kernels, strides, channels and resolutions of every convolution."""
    network, found = CostVolumeNet().eval(), {}

    def note(name: str, layer: nn.Conv2d | nn.Conv3d, output: torch.Tensor) -> None:
        kernel, stride, dilation = layer.kernel_size[0], layer.stride[0], layer.dilation[0]
        scale = HEIGHT // output.shape[2]
        found[name] = kernel, stride, dilation, layer.in_channels, layer.out_channels, scale

    for name, layer in network.named_modules():
        if isinstance(layer, nn.Conv2d | nn.Conv3d):
            layer.register_forward_hook(lambda layer, _, output, name=name: note(name, layer, output))
    with torch.no_grad():
        network(*torch.rand(2, 1, 3, HEIGHT, WIDTH))
    assert {
        name.removesuffix(".0") if name not in TABLE else name: row for name, row in found.items()
    } == TABLE
    assert sum(p.numel() for p in network.parameters()) == 730_855
    parts = {name: sum(p.numel() for p in part.parameters()) for name, part in network.named_children()}
    assert parts == {
        "descriptors": 451_664,
        "aggregation": 151_673,
        "half_weights": 10_468,
        "look": 101_484,
        "full_look": 15_566,
    }


def test_a_new_network_begins_with_the_volumes_disparity() -> None:
    torch.manual_seed(0)
    output = CostVolumeNet(NARROW)(*torch.rand(2, 2, 3, 32, 64))
    torch.testing.assert_close(output.coarse, output.half)
    torch.testing.assert_close(output.coarse, output.disparity)


@pytest.mark.parametrize(("height", "width"), [(50, 70), (64, 64), (17, 131), (1, 40), (40, 1)])
def test_large_pictures_are_padded_not_resized(height: int, width: int) -> None:
    """The answer is that for the picture with its last row and column repeated, cut back."""
    torch.manual_seed(0)
    network = CostVolumeNet(NARROW).eval()
    network.enlarged_to_pixels = height * width
    left, right = torch.rand(2, 1, 3, height, width)
    rows = torch.arange(-(-height // 32) * 32).clamp(max=height - 1)
    columns = torch.arange(-(-width // 32) * 32).clamp(max=width - 1)
    with torch.no_grad():
        views = left[:, :, rows][..., columns], right[:, :, rows][..., columns]
        whole = network.regress(*views, stretch=1.0).disparity
    found = estimate(network, None, None, left, right).disparity
    torch.testing.assert_close(found, whole[..., :height, :width])


@pytest.mark.parametrize(
    ("height", "width", "seen"),
    [
        (384, 1248, (576, 1856)),  # by 1.48, to about a million pixels
        (96, 160, (192, 320)),  # by 2 at most
        (384, 480, (768, 960)),
        (1088, 1920, None),
    ],
)
def test_small_pictures_are_enlarged(height: int, width: int, seen: tuple[int, int] | None) -> None:
    assert CostVolumeNet(NARROW).enlarged_size(height, width) == seen


def test_an_enlarged_pair_gives_disparities_of_its_own_pixels() -> None:
    """The answer is that for the pair enlarged by hand, brought back; it looks as far in the pictures."""
    torch.manual_seed(0)
    network = CostVolumeNet(NARROW).eval()
    left, right = torch.rand(2, 1, 3, 64, 96)
    larger = enlarged_by_hand(left, right)
    with torch.no_grad():
        seen = network(*larger, disparity_range=128)
    assert seen.scores.shape[-1] == 128 // 4
    found = estimate(network, None, None, left, right).disparity
    torch.testing.assert_close(found, F.avg_pool2d(F.relu(seen.disparity), 2) / 2, rtol=1e-4, atol=1e-4)
    network.look_up_to(32)
    assert searched(network, *larger, stretch=2.0) == [64]


def searched(network: CostVolumeNet, left: Tensor, right: Tensor, stretch: float | None) -> list[int]:
    """How far `regress` searches each volume, in pixels."""
    ranges = []
    handle = network.aggregation.register_forward_hook(
        lambda _, inputs, __: ranges.append(4 * inputs[0].shape[-1])
    )
    with torch.no_grad():
        network.regress(left, right, stretch)
    handle.remove()
    return ranges


def test_the_right_views_disparity_is_the_volumes_of_the_mirrored_pair() -> None:
    torch.manual_seed(0)
    network = CostVolumeNet(NARROW).eval()
    left, right = torch.rand(2, 2, 3, 32, 96)
    with torch.no_grad():
        found, disparity_right = network.both(left, right)
        alone = network.regress(left, right)
        mirrored = network(right.flip(-1), left.flip(-1)).coarse.flip(-1)
    torch.testing.assert_close(found.disparity, alone.disparity)
    torch.testing.assert_close(dict(found.features), dict(alone.features))
    assert disparity_right.shape == mirrored.shape
    # One is interpolated from half resolution, the other upsampled by learnt weights, untrained here.
    means = [F.avg_pool2d(maps, 8).flatten() for maps in (disparity_right, F.relu(mirrored))]
    assert torch.corrcoef(torch.stack(means))[0, 1] > 0.9


def enlarged_by_hand(left: Tensor, right: Tensor) -> list[Tensor]:
    """Twice as large."""
    options = {"scale_factor": 2, "mode": "bicubic", "align_corners": False, "antialias": True}
    return [F.interpolate(view, **options).clamp(0, 1) for view in (left, right)]  # type: ignore[arg-type]


def test_features_of_an_enlarged_pair_hold_disparities_of_its_own_pixels() -> None:
    """The joined features end in two disparities; all else is that of the enlarged pair, at half its size."""
    torch.manual_seed(0)
    network = CostVolumeNet(NARROW).eval()
    left, right = torch.rand(2, 1, 3, 64, 96)
    with torch.no_grad():
        expected = network.regress(*enlarged_by_hand(left, right), stretch=2.0).features
        found = regress_enlarged(network, left, right, (128, 192), 1.0).features
    scale = torch.ones(expected["joined"].shape[1], 1, 1)
    scale[-2:] = 0.5
    torch.testing.assert_close(found["joined"], F.avg_pool2d(expected["joined"], 2) * scale)
    torch.testing.assert_close(found["decoded"], F.avg_pool2d(expected["decoded"], 2))


def test_the_enlarged_pair_is_searched_as_far_as_its_own_answer_reaches() -> None:
    torch.manual_seed(0)
    network = CostVolumeNet(NARROW).eval()
    ranges = []
    network.aggregation.register_forward_hook(lambda _, inputs, __: ranges.append(4 * inputs[0].shape[-1]))
    answers = iter((30.0, 0.0))
    regression = network.regression

    def answered(output: CostVolumeOutput) -> Regression:
        found = regression(output)
        return Regression(torch.full_like(found.disparity, next(answers)), found.features)

    network.regression = answered  # type: ignore[method-assign]
    left, right = torch.rand(2, 1, 3, 64, 448)
    found = estimate(network, SureOnTheRight(), None, left, right)  # type: ignore[arg-type]
    assert ranges == [
        112 + 16,
        96,
    ]  # a quarter of the width; then (30 + 8) px, twice as many in the enlarged pair
    assert found.disparity.unique().tolist() == [0.0, 30.0]


class SureOnTheRight:
    """Stands for a ConfNet: surer of the second answer it sees, that for the pair as it is, in the right half."""

    config = HeadConfig()

    def __init__(self) -> None:
        self.seen = 0

    def inputs(
        self, features: Tensor, consistency: Tensor, cost_features: CostFeatures
    ) -> tuple[Tensor, ...]:
        assert features.shape[-1] * 2 == consistency.shape[-1] == cost_features.left.shape[-1]
        return (consistency,)

    def confidence(self, consistency: Tensor) -> Tensor:
        self.seen += 1
        width = consistency.shape[-1]
        right = torch.arange(width) >= width // 2
        return torch.where(right & (self.seen == 2), 0.9, 0.5).expand_as(consistency)


def test_the_surer_of_two_sizes_answers() -> None:
    """At pixels where both differ; without a ConfNet the enlarged pair does."""
    torch.manual_seed(0)
    network = CostVolumeNet(NARROW).eval()
    left, right = torch.rand(2, 1, 3, 64, 96)
    enlarged = estimate(network, None, None, left, right).disparity
    found = estimate(network, SureOnTheRight(), None, left, right)  # type: ignore[arg-type]
    network.enlarged_to_pixels = None
    own = estimate(network, None, None, left, right).disparity
    chosen = ((own - enlarged).abs() > 1.5) & (torch.arange(96) >= 48)
    assert 0.05 < chosen.float().mean() < 0.5
    torch.testing.assert_close(found.disparity, torch.where(chosen, own, enlarged), rtol=1e-4, atol=1e-3)
    assert found.confidence is not None
    torch.testing.assert_close(found.confidence, torch.where(chosen, 0.9, 0.5))


def test_heads_are_trained_on_crops_searched_as_far_as_the_regressors() -> None:
    """A crop is a part of a picture: what is near in it may be a larger share of its width."""
    network = CostVolumeNet(NARROW).eval()
    ranges = []
    network.aggregation.register_forward_hook(lambda _, inputs, __: ranges.append(4 * inputs[0].shape[-1]))
    left, right = torch.rand(2, 1, 3, 32, 320)
    with torch.no_grad():
        network(left, right)
        head_inputs(network, None, None, left, right)
        network.regress(left, right, stretch=1.0)
    assert ranges == [160, 160, 96]


def test_heads_learn_from_both_answers() -> None:
    """Half of the crops are judged as they are seen enlarged, at their own size, against the right view as it is."""
    torch.manual_seed(0)
    network = CostVolumeNet(NARROW).eval()
    config = HeadConfig(width=4, hidden=4).on(network)
    confnet, gradnet = ConfNet(config), GradNet(config)
    left, right = torch.rand(2, 3, 3, 64, 96)
    with torch.no_grad():
        seen = crop_inputs(network, confnet, None, left, right, 0.5)
        slopes = crop_inputs(network, None, gradnet, left, right, 0.5)
        own = head_inputs(network, confnet, None, left, right)
        enlarged = regress_enlarged(network, left[:1], right[:1], (128, 192), 1.0)
    close = partial(torch.testing.assert_close, rtol=1e-4, atol=1e-4)
    for found in (seen, slopes):
        close(found.regression.disparity[:1], enlarged.disparity)
        close(found.regression.disparity[1:], own.regression.disparity[1:])
        close(found.regression.features["joined"][:1], enlarged.features["joined"])
        close(found.regression.features["joined"][1:], own.regression.features["joined"][1:])
    assert (enlarged.disparity - own.regression.disparity[:1]).abs().max() > 1
    consistency, expected = seen.confnet[2], own.confnet[2]
    close(consistency[1:], expected[1:])
    assert consistency.shape == expected.shape
    assert crop_inputs(network, None, None, left, right, 0.3).regression.disparity.shape == (3, 1, 64, 96)
    network.enlarged_to_pixels = None
    with torch.no_grad():
        close(crop_inputs(network, confnet, None, left, right, 0.5).confnet, own.confnet)


def test_the_range_can_be_set_and_changes_no_weights() -> None:
    network = CostVolumeNet(NARROW).eval()
    left, right = torch.rand(2, 1, 3, 32, 160)
    assert network(left, right).scores.shape[-1] == 64 // 4
    network.look_up_to(100)
    assert network(left, right).scores.shape[-1] == 128 // 4
    with pytest.raises(TrainingError, match="must be positive"):
        network.look_up_to(0)
    with pytest.raises(TrainingError, match="as far as it was trained to"):
        DispNetCorr1D(DispNetConfig(width=0.0625)).look_up_to(100)


@pytest.mark.parametrize(
    ("width", "pixels"), [(32, 32), (320, 96), (450, 128), (1242, 192), (1920, 256), (2976, 384)]
)
def test_the_range_suits_the_width(width: int, pixels: int) -> None:
    assert CostVolumeNet(NARROW).disparity_range(width) == pixels


def test_wide_pictures_are_searched_at_half_their_size_and_looked_at_at_full() -> None:
    network = CostVolumeNet(NARROW).eval()
    left, right = torch.rand(2, 1, 3, 96, 160)
    whole = network(left, right)
    network.largest_volume_pixels = 10_000
    output = network(left, right)
    assert whole.scores.shape == (1, 24, 40, 16)
    # 48x80, padded to multiples of 32; half the range, in levels of 4
    assert output.scores.shape == (1, 16, 24, 8)
    assert output.disparity.shape == whole.disparity.shape == (1, 1, 96, 160)
    assert output.joined.shape == whole.joined.shape


def test_the_third_look_takes_strips_where_nothing_is_trained() -> None:
    """Whatever the strips' height, each row gets the answer of the whole picture."""
    torch.manual_seed(0)
    network = CostVolumeNet(NARROW).eval()
    nn.init.normal_(network.full_look.decide.weight, std=0.3)
    left, right = torch.rand(2, 1, 3, 224, 96)
    whole = network(left, right).disparity  # with gradients: all at once
    for rows in (None, 16, 96, 200):
        network.strip_rows = rows
        with torch.no_grad():
            strips = network(left, right)
        torch.testing.assert_close(strips.disparity, whole)
    assert (strips.disparity - strips.half).abs().max() > 0.1


def test_the_wrong_size_is_refused() -> None:
    with pytest.raises(ValueError, match="multiple of 32"):
        CostVolumeNet(NARROW)(*torch.rand(2, 1, 3, 32, 40))


def test_regressors_are_found_by_name_and_by_their_options() -> None:
    assert known_regressors() == {"costvolume": CostVolumeNet, "dispnet": DispNetCorr1D}
    assert regressor_for(NARROW) is CostVolumeNet
    with pytest.raises(TrainingError, match="there are costvolume, dispnet"):
        find_regressor("psmnet")


def test_ground_truth_beyond_the_range_and_without_a_value_counts_nothing() -> None:
    torch.manual_seed(0)
    network, objective = CostVolumeNet(NARROW), CostVolumeObjective()
    output = network(*torch.rand(2, 1, 3, 32, 64))
    truth = torch.rand(1, 1, 32, 64) * 20
    partial = truth.clone()
    partial[..., :8] = torch.nan
    beyond = partial.clone()
    beyond[..., :8] = 500.0
    assert objective(output, partial, 0.0) == objective(output, beyond, 0.0)
    assert objective(output, torch.full_like(truth, torch.nan), 0.0) == 0


def test_the_best_scores_are_those_of_the_target() -> None:
    """Cross-entropy is least where the softmax is the Laplacian itself."""
    truth = torch.full((1, 1, 8, 12), 3.3)
    levels = torch.arange(6.0)
    own = -(levels - 3.3).abs() / 0.5
    at_best = level_cross_entropy(own.expand(1, 2, 3, 6), truth, 0.5)
    for shift in (0.3 * torch.randn(6, generator=torch.Generator().manual_seed(k)) for k in range(5)):
        assert level_cross_entropy((own + shift).expand(1, 2, 3, 6), truth, 0.5) > at_best


def test_smooth_l1_is_squared_near_zero_and_linear_beyond() -> None:
    truth = torch.tensor([1.0, 2.0, torch.nan]).view(1, 1, 1, 3)
    prediction = torch.tensor([1.2, 5.0, 9.0]).view(1, 1, 1, 3)
    expected = (0.2**2 / (2 * 0.5) + (3.0 - 0.5 / 2)) / 2
    assert float(disparity_smooth_l1(prediction, truth, 0.5)) == pytest.approx(expected)


def test_it_learns_a_shift() -> None:
    """Noise that a pair shows moved by one disparity: after a few steps most pixels are right."""
    torch.manual_seed(0)
    network, objective = CostVolumeNet(NARROW).train(), CostVolumeObjective()
    optimizer = torch.optim.Adam(network.parameters(), 3e-3)
    generator = torch.Generator().manual_seed(1)

    def batch() -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        coarse, fine = (torch.rand(2, 3, *size, generator=generator) for size in ((8, 32), (32, 128)))
        right = 0.7 * F.interpolate(coarse, scale_factor=4, mode="bilinear") + 0.3 * fine
        shift = int(torch.randint(0, 40, (1,), generator=generator))
        return right.roll(shift, -1), right, torch.full((2, 1, 32, 128), float(shift))

    for _ in range(160):
        left, right, truth = batch()
        optimizer.zero_grad()
        objective(network(left, right), truth, 0.0).backward()
        optimizer.step()
    with torch.no_grad():
        errors = []
        for _ in range(5):
            left, right, truth = batch()
            errors.append((network.regress(left, right).disparity - truth)[..., 40:].abs() < 1)
    assert torch.stack(errors).float().mean() > 0.8
