"""No message is longer than 300 characters, whatever it names."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from datagen.errors import FormatError
from datagen.sources.missing import describe_missing
from stereoforge.cli import main
from stereoforge.progress import remark
from stereoforge_kit.errors import UserError
from stereoforge_kit.messages import LONGEST_MESSAGE

ROOT = Path(__file__).parents[2]
PACKAGES = ("scenes", "datagen", "training", "refine", "stereoforge", "stereoforge_kit")
USUAL_LENGTH, NUMBER_LENGTH = 30, 5
"""Of what is filled into a message."""


def raised_messages() -> Iterator[tuple[str, ast.expr]]:
    """Where an exception is raised with a text, and the text."""
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            for node in ast.walk(ast.parse(path.read_text())):
                if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call) and node.exc.args:
                    yield f"{path.relative_to(ROOT)}:{node.lineno}", node.exc.args[0]


def constants(text: ast.expr) -> int:
    parts = (part.value for part in ast.walk(text) if isinstance(part, ast.Constant))
    return sum(len(part) for part in parts if isinstance(part, str))


def filled_in(text: ast.expr) -> list[int]:
    """The usual lengths of what is filled in; what has a format is a number."""
    parts = [part for part in ast.walk(text) if isinstance(part, ast.FormattedValue)]
    return [NUMBER_LENGTH if part.format_spec else USUAL_LENGTH for part in parts]


def test_every_message_is_short_as_it_is_written() -> None:
    lengths = {where: constants(text) + sum(filled_in(text)) for where, text in raised_messages()}
    assert len(lengths) > 300
    assert {where: length for where, length in lengths.items() if length > LONGEST_MESSAGE} == {}


def test_lists_that_a_user_decides_are_shortened_by_one_helper() -> None:
    """What is joined in a message is a constant of the program, or goes through `listed`."""
    ours = {
        "kinds",
        "known",
        "names",
        "parts",
        "presets",
        "sorted(known)",
        "self.suffixes",
        "sorted(FAMILIES)",
    }
    joined = [
        (where, argument)
        for where, text in raised_messages()
        for call in ast.walk(text)
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Attribute) and call.func.attr == "join"
        for argument in map(ast.unparse, call.args)
        if not argument.isupper() and argument not in ours and "split()" not in argument
    ]
    assert joined == []


def test_the_middle_of_an_error_is_left_out() -> None:
    path = Path("/", *["folder"] * 200, "picture.png")
    error = FormatError(f"{path}: is no picture")
    assert len(str(error)) == LONGEST_MESSAGE
    assert str(error).startswith("/folder/")
    assert str(error).endswith("/picture.png: is no picture")
    assert isinstance(error, UserError)
    missing = {number: [path / f"{number}.png"] for number in range(5000)}
    assert len(describe_missing(str(path), missing, 5000)) < LONGEST_MESSAGE


LONG = "x" * 200
COMMANDS = {
    "unknown method": ["evaluate", "nowhere", "--methods", *(f"method{k}" for k in range(500))],
    "missing folder": ["verify", "/".join([LONG] * 15)],
    "wrong flag": ["render", "--out", "x", "--passes", ",".join(["clean"] * 500)],
    "wrong size": ["render", "--out", "x", "--size", LONG * 5],
    "no command": [LONG * 5],
    "wrong number": ["render", "--out", "x", "--scenes", LONG * 5],
    "name too long": ["refine", LONG * 2, LONG * 2, "--out", "out"],
    "no such plan": ["study", "--plan", "/".join([LONG] * 15), "--out", "out"],
}


@pytest.mark.parametrize("words", COMMANDS.values(), ids=COMMANDS)
def test_what_a_command_says_is_short(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as end:
        main(words)
    assert end.value.code in (1, 2)
    (said,) = capfd.readouterr().err.splitlines()
    assert 20 < len(said) <= LONGEST_MESSAGE
    assert "unexpected" not in said


def test_a_recipe_of_thousands_of_faults_is_refused_shortly(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    recipe = tmp_path / "recipe.yaml"
    recipe.write_text("\n".join(f"field_{k}: {int(v)}" for k, v in enumerate(np.zeros(3000))))
    with pytest.raises(SystemExit):
        main(["render", "--out", str(tmp_path / "set"), "--recipe", str(recipe)])
    (said,) = capfd.readouterr().err.splitlines()
    assert len(said) <= LONGEST_MESSAGE


def test_remarks_are_short_and_brackets_in_them_stay(capsys: pytest.CaptureFixture[str]) -> None:
    """rich takes `[v1]` for its markup, and ends the program at `[/v1]`."""
    remark(f"sets/wds[v1]/[/v1]: {LONG * 9}: left out")
    (said,) = capsys.readouterr().out.splitlines()
    assert said.startswith("sets/wds[v1]/[/v1]: ")
    assert len(said) == LONGEST_MESSAGE
