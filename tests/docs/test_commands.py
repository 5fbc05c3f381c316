"""Every command that the pages print is one that the command line takes."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from stereoforge.cli import main
from stereoforge.commands import command_class
from tests.docs.pages import PAGES, blocks, name_of

COMMENT = re.compile(r"(^|\s)#.*")
"""As a shell has it: within a word # is no comment."""
SHELL_WORDS = {";", "done", "&&"}


def commands(page: Path) -> list[list[str]]:
    """The words after `stereoforge` of each command in the page's blocks of shell."""
    found = []
    for block in blocks(page):
        for line in block.replace("\\\n", " ").splitlines():
            if "stereoforge " not in line or line.startswith(("stereoforge:", "pip ", "#")):
                continue
            words = shlex.split(COMMENT.sub("", line).replace(";", " ; "))
            if "stereoforge" not in words:
                continue
            words = words[words.index("stereoforge") + 1 :]
            end = next((at for at, word in enumerate(words) if word in SHELL_WORDS), len(words))
            found.append(words[:end])
    return found


COMMANDS = [
    pytest.param(words, id=f"{name_of(page)}: {' '.join(words)}")
    for page in PAGES
    for words in commands(page)
]


def test_the_pages_print_commands() -> None:
    assert len(COMMANDS) > 40


@pytest.mark.parametrize("words", COMMANDS)
def test_the_command_line_takes_it(words: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    name, *arguments = (word.replace("$network", "regressor") for word in words)
    monkeypatch.setattr(command_class(name), "run", lambda _: None)
    with pytest.raises(SystemExit) as ended:
        main([name, *arguments])
    assert ended.value.code == 0
