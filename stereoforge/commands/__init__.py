"""One module a command: a frozen dataclass whose fields are its flags and whose `run` does the work.

A command's module is imported when it is asked for: together they bring along half a dozen libraries.
"""

from importlib import import_module
from typing import Any, Protocol

COMMANDS = {
    "render": "Render",
    "verify": "Verify",
    "view": "View",
    "export": "Export",
    "train": "Train",
    "export-model": "ExportModel",
    "tune": "Tune",
    "refine": "Refine",
    "evaluate": "Evaluate",
    "study": "Study",
    "demo": "Demo",
}
"""Every command by its name, in the order of use, and its class in the module of that name."""


class Command(Protocol):
    """What the parser builds from the words after a command's name."""

    def run(self) -> None:
        """Do the work; whatever it raises becomes one sentence and an exit code."""


def command_class(name: str) -> type[Command]:
    """The dataclass of one of `COMMANDS`."""
    module = import_module(f"stereoforge.commands.{name.replace('-', '_')}")
    found: type[Command] = getattr(module, COMMANDS[name])
    return found


def after_interruption(command: Any) -> str:
    """What running a command again does that was interrupted: its own `interrupted`, where it has one."""
    return str(getattr(command, "interrupted", "the same command run again starts anew"))
