"""ConfNet, GradNet and the left-right-consistency map."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import nn

from training.networks import (
    ConfNet,
    DispNetConfig,
    DispNetCorr1D,
    GradNet,
    HeadConfig,
    left_right_consistency,
    predict_right,
)
from training.networks.cost_features import (
    COST_FEATURE_CHANNELS,
    COST_OFFSETS_PX,
    SLOPE_CHANNELS,
    CostFeatures,
    smooth_slopes,
)
from training.networks.inference import head_inputs
from training.networks.regressors.dispnet import FeatureKind


@pytest.mark.parametrize(
    ("network", "inputs", "activation", "dropout"),
    [(ConfNet(), 101, nn.ReLU, 0.5), (GradNet(), 100, nn.LeakyReLU, 0.2)],
)
def test_published_layers(
    network: ConfNet | GradNet, inputs: int, activation: type[nn.Module], dropout: float
) -> None:
    """Four 3x3 convolutions, a 1x1 as full connection, dropout, a 1x1 output of two channels."""
    layers = list(network.layers)
    shapes = [(c.kernel_size[0], c.in_channels, c.out_channels) for c in layers if isinstance(c, nn.Conv2d)]
    assert shapes == [(3, inputs, 64), (3, 64, 64), (3, 64, 64), (3, 64, 64), (1, 64, 128), (1, 128, 2)]
    assert [type(layer) for layer in layers] == [nn.Conv2d, activation] * 5 + [nn.Dropout, nn.Conv2d]
    assert layers[-2].p == dropout
    assert all(layer.negative_slope == 0.1 for layer in layers if isinstance(layer, nn.LeakyReLU))


@pytest.mark.parametrize("half", [False, True])
def test_outputs_cover_every_pixel(half: bool) -> None:
    config = HeadConfig(feature_channels=5, width=4, hidden=4, half_resolution=half)
    image, features, consistency = (
        torch.rand(2, 3, 32, 64),
        torch.rand(2, 5, 16, 32),
        torch.rand(2, 1, 32, 64),
    )
    confidence = ConfNet(config).eval().confidence(image, features, consistency)
    assert confidence.shape == (2, 1, 32, 64)
    assert ((confidence >= 0) & (confidence <= 1)).all()
    assert GradNet(config)(image, features).shape == (2, 2, 32, 64)


def test_confnet_sees_cost_features_where_configured() -> None:
    """The published inputs come first, and the right view changes nothing but the cost features."""
    torch.manual_seed(0)
    config = HeadConfig(feature_channels=5, width=4, hidden=4, cost_features=True)
    network = ConfNet(config).eval()
    left, right, other = torch.rand(3, 1, 3, 32, 64)
    features, disparity, consistency = (
        torch.rand(1, 5, 16, 32),
        torch.rand(1, 1, 32, 64) * 9,
        torch.rand(1, 1, 32, 64),
    )
    seen, seen_otherwise = (
        network.inputs(features, consistency, CostFeatures(left, view, disparity)) for view in (right, other)
    )
    joined, changed = network.joined_input(*seen), network.joined_input(*seen_otherwise)
    plain = ConfNet(replace(config, cost_features=False))
    assert plain.inputs(features, consistency, CostFeatures(left, right, disparity)) == (
        left,
        features,
        consistency,
    )
    torch.testing.assert_close(joined[:, :9], plain.joined_input(left, features, consistency))
    assert joined.shape == (1, 9 + COST_FEATURE_CHANNELS, 32, 64)
    differs = (joined != changed).flatten(2).any(2)[0]
    assert differs.nonzero().flatten().tolist() == list(range(9, 9 + len(COST_OFFSETS_PX)))
    assert network.confidence(*seen).shape == (1, 1, 32, 64)


def test_gradnet_sees_cost_features_where_configured() -> None:
    torch.manual_seed(0)
    config = HeadConfig(feature_channels=5, width=4, hidden=4, cost_features=True)
    left, right = torch.rand(2, 1, 3, 32, 64)
    features, disparity = torch.rand(1, 5, 16, 32), torch.rand(1, 1, 32, 64) * 9
    network, plain = GradNet(config), GradNet(replace(config, cost_features=False))
    cost_features = CostFeatures(left, right, disparity)
    assert plain.inputs(features, cost_features) == (left, features)
    joined = network.joined_input(*network.inputs(features, cost_features))
    assert joined.shape == (1, 8 + COST_FEATURE_CHANNELS + SLOPE_CHANNELS, 32, 64)
    torch.testing.assert_close(joined[:, :8], plain.joined_input(left, features))
    torch.testing.assert_close(joined[:, -SLOPE_CHANNELS:], smooth_slopes(disparity))
    assert network(*network.inputs(features, cost_features)).shape == (1, 2, 32, 64)


def test_inputs_are_standardized_with_fixed_numbers() -> None:
    """Measured statistics make the given inputs zero-mean and of unit deviation, whatever the batch."""
    config = HeadConfig(feature_channels=2, width=4, hidden=4)
    network = GradNet(config).eval()
    torch.manual_seed(0)
    image, features = torch.rand(1, 3, 8, 8), torch.randn(1, 2, 4, 4) * 30 + 100
    joined = network.joined_input(image, features)
    network.standardize(joined.mean((0, 2, 3)), joined.std((0, 2, 3)))
    seen: list[torch.Tensor] = []
    network.layers[0].register_forward_pre_hook(lambda _, inputs: seen.append(inputs[0]))
    network(image, features)
    network(image, features + 30)
    torch.testing.assert_close(seen[0].mean((0, 2, 3)), torch.zeros(5), atol=1e-5, rtol=0)
    torch.testing.assert_close(seen[0].std((0, 2, 3)), torch.ones(5), atol=1e-5, rtol=0)
    assert (seen[1].mean((0, 2, 3))[3:] > 0.5).all()


def consistency_by_the_formula(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Eq. 1 with 1-based columns j, the match rounded to the nearest column."""
    height, width = left.shape
    result = np.empty_like(left)
    for i in range(height):
        for j in range(1, width + 1):
            match = int(np.floor(j - left[i, j - 1] + 0.5))
            result[i, j - 1] = abs(left[i, j - 1] - right[i, match - 1]) if match > 0 else -1
    return result


@settings(max_examples=30, deadline=None)
@given(width=st.integers(1, 20), seed=st.integers(0, 1000))
def test_consistency_equals_the_formula(width: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    left, right = rng.uniform(0, 12, (2, 3, width))
    got = left_right_consistency(torch.from_numpy(left)[None, None], torch.from_numpy(right)[None, None])
    np.testing.assert_allclose(got[0, 0], consistency_by_the_formula(left, right))


def test_right_view_is_the_left_view_of_the_mirrored_pair() -> None:
    """With a predictor that returns its first image's red channel, the right image's own comes back."""
    left, right = torch.rand(2, 1, 3, 4, 6)
    torch.testing.assert_close(predict_right(lambda a, b: a[:, :1] + 0 * b[:, :1], left, right), right[:, :1])


def test_one_pass_gives_both_views() -> None:
    torch.manual_seed(0)
    regressor = DispNetCorr1D(DispNetConfig(width=0.0625)).eval()
    left, right = torch.rand(2, 2, 3, 64, 64)
    with torch.no_grad():
        regression, disparity_right = regressor.both(left, right)
        alone = regressor.regress(left, right)
        mirrored = predict_right(lambda a, b: regressor.regress(a, b).disparity, left, right)
    torch.testing.assert_close(regression.disparity, alone.disparity)
    torch.testing.assert_close(dict(regression.features), dict(alone.features))
    torch.testing.assert_close(disparity_right, mirrored)


@pytest.mark.parametrize("kind", ["joined", "decoded"])
def test_heads_see_the_features_they_are_configured_for(kind: FeatureKind) -> None:
    """Of a regressor whose finest decoder answers zero, one kind of features is zero and the other is not."""
    torch.manual_seed(0)
    regressor = DispNetCorr1D(DispNetConfig(width=0.25)).eval()
    for parameter in regressor.stage1.iconv.parameters():
        nn.init.zeros_(parameter)
    config = HeadConfig(width=4, hidden=4, features=kind).on(regressor)
    assert config.feature_channels == {"joined": 25, "decoded": 8}[kind]
    confnet, gradnet = ConfNet(config), GradNet(config)
    left, right = torch.rand(2, 1, 3, 64, 64)
    with torch.no_grad():
        seen = head_inputs(regressor, confnet, gradnet, left, right)
        for features in (seen.confnet[1], seen.gradnet[1]):
            assert features.shape == (1, config.feature_channels, 32, 32)
            assert bool((features == 0).all()) == (kind == "decoded")
        assert confnet(*seen.confnet).shape == (1, 2, 64, 64)
        assert gradnet(*seen.gradnet).shape == (1, 2, 64, 64)
