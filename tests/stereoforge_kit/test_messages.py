"""Messages stay short whatever they name."""

from __future__ import annotations

from stereoforge_kit.messages import listed, shortened


def test_the_middle_of_a_long_text_is_left_out() -> None:
    assert shortened("as it is", 8) == "as it is"
    assert shortened("two\nlines", 20) == "two lines"
    path = "/home/someone/" + "deep/" * 100 + "picture.png"
    brief = shortened(path, 60)
    assert len(brief) == 60
    assert brief.startswith("/home/someone/")
    assert brief.endswith("/picture.png")


def test_of_a_long_list_the_first_are_named() -> None:
    assert listed(["a", "b"]) == "a, b"
    assert listed(range(9), most=2) == "0, 1 and 7 more"
    assert len(listed(["x" * 500] * 500)) < 260
