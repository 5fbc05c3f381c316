"""What every family's config refuses, whatever its own fields are."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from scenes import FAMILIES
from scenes.families.flying_things import FlyingThingsConfig

NAN, INFINITY = float("nan"), float("inf")


@pytest.mark.parametrize(
    ("family", "changes", "sentence"),
    [
        ("flying_things", {"flying_objects": (-5, 2)}, "flying_objects must not be negative"),
        ("flying_things", {"flying_objects": (5, 2)}, r"flying_objects must be \(low, high\)"),
        ("flying_things", {"baseline_m": (NAN, NAN)}, "baseline_m must be finite"),
        ("flying_things", {"user_share": 1.5}, "user_share must be in 0..1"),
        ("driving", {"view_m": (100.0, INFINITY)}, "view_m must be finite"),
        ("driving", {"focal_lengths_mm": (15.0, NAN)}, "focal_lengths_mm must be finite"),
        ("driving", {"frames": 0}, "frames must be at least 1"),
        ("monkaa", {"creatures": (-5, -2)}, "creatures must not be negative"),
        ("sintel", {"fog_share": 3.0}, "fog_share must be in 0..1"),
    ],
)
def test_numbers_that_nothing_can_be_drawn_from_are_refused(
    family: str, changes: dict[str, Any], sentence: str
) -> None:
    with pytest.raises(ValueError, match=sentence):
        FAMILIES[family].config(**changes)


@pytest.mark.parametrize("family", sorted(FAMILIES))
def test_every_family_says_what_of_it_can_be_fewer_and_shows_files_of_the_user_s(family: str) -> None:
    kind = FAMILIES[family]
    assert kind.takes_assets
    assert kind.config().at_complexity(0.0) != kind.config()


@pytest.mark.parametrize("emptiest", [0.1, 0.5])
def test_every_family_s_emptiest_worlds_have_the_same_share_left(
    emptiest: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("scenes.family.EMPTIEST", emptiest)
    street = FAMILIES["driving"].config()
    assert street.at_complexity(0.0).parked_share == tuple(each * emptiest for each in street.parked_share)
    emptied = FlyingThingsConfig().at_complexity(0.0)
    assert emptied.count(np.random.default_rng(0), (100, 100)) == round(100 * emptiest)
