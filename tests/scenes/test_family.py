"""What every family's config refuses, whatever its own fields are."""

from __future__ import annotations

from typing import Any

import pytest

from scenes import FAMILIES

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
