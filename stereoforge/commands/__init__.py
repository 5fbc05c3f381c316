"""One module a command: a frozen dataclass whose fields are its flags and whose `run` does the work."""

from collections.abc import Callable
from typing import Any, Protocol

from stereoforge.commands.demo import Demo
from stereoforge.commands.evaluate import Evaluate
from stereoforge.commands.export import Export
from stereoforge.commands.export_model import ExportModel
from stereoforge.commands.refine import Refine
from stereoforge.commands.render import Render
from stereoforge.commands.study import Study
from stereoforge.commands.train import Train
from stereoforge.commands.tune import Tune
from stereoforge.commands.verify import Verify
from stereoforge.commands.view import View


class Command(Protocol):
    """What the parser builds from the words after a command's name."""

    def run(self) -> None:
        """Do the work; whatever it raises becomes one sentence and an exit code."""


COMMANDS: dict[str, Callable[..., Command]] = {
    "render": Render,
    "verify": Verify,
    "view": View,
    "export": Export,
    "train": Train,
    "export-model": ExportModel,
    "tune": Tune,
    "refine": Refine,
    "evaluate": Evaluate,
    "study": Study,
    "demo": Demo,
}
"""Every command by its name, in the order of use."""


def after_interruption(command: Any) -> str:
    """What running a command again does that was interrupted: its own `interrupted`, where it has one."""
    return str(getattr(command, "interrupted", "the same command run again starts anew"))
