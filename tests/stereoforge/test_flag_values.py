"""Values of flags: what is a weight and what is part of a location."""

from __future__ import annotations

from pathlib import Path

import pytest

from stereoforge.errors import UsageError
from stereoforge.inputs.flag_values import parse_weighted_source


@pytest.mark.parametrize(
    ("text", "source", "weight"),
    [
        ("data", "data", 1.0),
        ("data:2.5", "data", 2.5),
        ("kitti2015:~/x:2", "kitti2015:~/x", 2.0),
        ("kitti2015:2015", "kitti2015:2015", 1.0),
        ("http://host:8000", "http://host:8000", 1.0),
        ("webdataset:http://host:8000", "webdataset:http://host:8000", 1.0),
        ("webdataset:http://user:pw@host:8000", "webdataset:http://user:pw@host:8000", 1.0),
        ("webdataset:http://[::1]:8000", "webdataset:http://[::1]:8000", 1.0),
        ("webdataset:http://host:8000/x", "webdataset:http://host:8000/x", 1.0),
        ("webdataset:http://host:8000/x:2", "webdataset:http://host:8000/x", 2.0),
        ("webdataset:http://host:8000:2", "webdataset:http://host:8000", 2.0),
    ],
)
def test_weights_of_sources(text: str, source: str, weight: float) -> None:
    assert parse_weighted_source(text) == (source, weight)


def test_a_folder_of_such_a_name_wins(tmp_path: Path) -> None:
    (tmp_path / "set:2").mkdir()
    for text in (f"{tmp_path}/set:2", f"kitti2015:{tmp_path}/set:2"):
        assert parse_weighted_source(text) == (text, 1.0)
    assert parse_weighted_source(f"{tmp_path}/set:2:3") == (f"{tmp_path}/set:2", 3.0)


@pytest.mark.parametrize("number", ["0", "-1", "inf", "nan"])
def test_weights_are_positive(number: str) -> None:
    with pytest.raises(UsageError, match="must be positive"):
        parse_weighted_source(f"data:{number}")
