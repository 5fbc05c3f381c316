"""One module a command: a frozen dataclass whose fields are its flags and whose `run` does the work.

A command's module is imported when it is asked for: together they bring along half a dozen libraries.
"""

import ast
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Protocol

COMMANDS = {
    "render": "Render",
    "verify": "Verify",
    "view": "View",
    "export": "Export",
    "train": "Train",
    "export-model": "ExportModel",
    "tune": "Tune",
    "check": "Check",
    "rectify": "Rectify",
    "refine": "Refine",
    "app": "App",
    "evaluate": "Evaluate",
    "study": "Study",
    "demo": "Demo",
    "warm-up": "WarmUp",
}
"""Every command by its name, in the order of use, and its class in the module of that name."""


class Command(Protocol):
    """What the parser builds from the words after a command's name."""

    def run(self) -> None:
        """Do the work; whatever it raises becomes one sentence and an exit code."""


def command_class(name: str) -> type[Command]:
    """The dataclass of one of `COMMANDS`."""
    found: type[Command] = getattr(import_module(_module(name)), COMMANDS[name])
    return found


def command_summary(name: str) -> str:
    """What one of `COMMANDS` does: how the docstring of its class begins, without importing its module."""
    spec = find_spec(_module(name))
    assert spec is not None
    assert spec.origin is not None
    for node in ast.parse(Path(spec.origin).read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ClassDef) and node.name == COMMANDS[name]:
            return (ast.get_docstring(node) or "").split("\n\n")[0]
    raise AssertionError(f"no class {COMMANDS[name]} in {spec.origin}")


def _module(name: str) -> str:
    return f"stereoforge.commands.{name.replace('-', '_')}"


def after_interruption(command: Any) -> str:
    """What running a command again does that was interrupted: its own `interrupted`, where it has one."""
    return str(getattr(command, "interrupted", "the same command run again starts anew"))
