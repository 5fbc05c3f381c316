"""Entry point: parse, run one command, and turn every expected failure into one clear sentence."""

from __future__ import annotations

import contextlib
import io
import re
import signal
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from stereoforge.commands import COMMANDS, after_interruption, command_class, command_summary
from stereoforge.temporary_files import temporary_files_in_out
from stereoforge_kit.errors import UserError
from stereoforge_kit.messages import LONGEST_MESSAGE, shortened
from stereoforge_kit.siblings import check_siblings

DEBUG_FLAG = "--debug"
PROGRAM = "stereoforge: "
DESCRIPTION = (
    "Make stereo training sets in Blender, train stereo networks on them, refine disparity.\n\n"
    f"Every command has --help, and takes {DEBUG_FLAG} to show where a failure came from. --version says which this is."
)
MISSING_PARTS = {
    "bpy": "rendering needs Blender: pip install 'stereoforge[render]' on Python 3.11 (bpy 4.5) or 3.13 (bpy 5.2)",
    "torch": "networks need PyTorch: pip install torch, then pip install 'stereoforge[train]'",
    "av": "reading and writing videos needs PyAV: pip install 'stereoforge[video]'",
    "onnxruntime": "ONNX needs its runtime: pip install 'stereoforge[onnx]'",
    "ray": "--executor ray needs Ray: pip install 'stereoforge[ray]'",
    "fsspec": "data sets behind URLs need fsspec: pip install 'stereoforge[cloud]'",
    "s3fs": "s3:// needs s3fs: pip install 'stereoforge[cloud]'",
    "pytorch_lightning": "training needs Lightning: pip install 'stereoforge[train]'",
}


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; always ends in SystemExit: 0 success, 1 failure, 2 wrong usage, 130 interrupted."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    debug = DEBUG_FLAG in words
    if words == ["--version"]:
        print(f"stereoforge {version('stereoforge')}")
        sys.exit(0)
    command = None
    try:
        _leave_current_folder()
        check_siblings(__file__, "scenes", "datagen", "training", "refine")
        with _terminated_like_interrupted(), temporary_files_in_out(words):
            command = _parse([word for word in words if word != DEBUG_FLAG])
            command.run()
    except KeyboardInterrupt:
        sys.exit(_say(f"interrupted; {after_interruption(command)}", 130))
    except Exception as error:
        if _was_interrupted(error):
            sys.exit(_say(f"interrupted; {after_interruption(command)}", 130))
        if debug:
            raise
        sys.exit(_say(*_explain(error)))
    sys.exit(0)


def _was_interrupted(error: Exception) -> bool:
    """Whether it is what numba makes of an interruption that arrives within a compiled function."""
    return isinstance(error, SystemError) and isinstance(error.__cause__, KeyboardInterrupt)


def _leave_current_folder() -> None:
    """Import nothing from the current folder, where `python -m` and an empty entry in PYTHONPATH look first.

    Unless the program lies there: `training` and `scenes` are what many folders of other projects are called.
    """
    here, home = Path.cwd(), Path(__file__).resolve().parent.parent
    if here != home:
        sys.path[:] = [entry for entry in sys.path if Path(entry).resolve() != here]


@contextlib.contextmanager
def _terminated_like_interrupted() -> Iterator[None]:
    """Let SIGTERM, a scheduler's way to say stop, end a command as cleanly as Ctrl-C."""
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _parse(words: Sequence[str]) -> Any:
    """The command the words ask for; SystemExit 2 with one sentence if they ask for none, 0 after --help."""
    import tyro  # half a second in which an interruption is to be as clean as later

    settings: dict[str, Any] = {
        "config": (tyro.conf.OmitArgPrefixes, tyro.conf.FlagCreatePairsOff, tyro.conf.HelptextFromCommentsOff)
    }
    complaint = io.StringIO()
    try:
        with contextlib.redirect_stderr(complaint):
            if words and words[0] in COMMANDS:
                found = command_class(words[0])
                return tyro.cli(found, prog=f"stereoforge {words[0]}", args=words[1:], **settings)
            # No command: help or a complaint, for neither of which all of them have to be imported.
            return tyro.extras.subcommand_cli_from_dict(
                {name: dataclass(type(name, (), {"__doc__": command_summary(name)})) for name in COMMANDS},
                prog="stereoforge",
                description=DESCRIPTION,
                args=words,
                **settings,
            )
    except SystemExit as end:
        if end.code == 2:
            _say(_one_sentence(complaint.getvalue()), 2)
        raise


def _one_sentence(complaint: str) -> str:
    """What one of tyro's boxes says, drawn with lines or with dashes: title, complaint, suggestions."""
    bare = complaint.translate(dict.fromkeys(map(ord, "╭╮╰╯│"), " "))
    parts = [" ".join(part.split()) for part in re.split(r"[─-]{5,}", bare)]
    _, said, *others = [part for part in parts if part.strip("─ ")]
    sentence = _plain(said.split(" Got errors:")[0])
    for other in others:
        if other.startswith("Perhaps you meant:"):
            sentence += f" (perhaps you meant {other.split()[3]}?)"
        elif other.startswith("Available subcommands:"):
            sentence += f" (a{other[1:]})"
    return sentence


def _plain(complaint: str) -> str:
    """tyro's complaint about a flag's value in a user's words: no types, and no None among the choices."""
    if wanted := re.search(
        r"Error parsing (\S+): no type matching .*\b(INT|FLOAT)\b.* from \['(.*)'\]", complaint
    ):
        kind = {"INT": "a whole number", "FLOAT": "a number"}[wanted[2]]
        return f"{wanted[1]} takes {kind}, not {wanted[3]!r}"
    if wanted := re.search(
        r"Error parsing (\S+): (?:invalid literal for int|could not convert).*: '(.*)'", complaint
    ):
        return f"{wanted[1]} takes a {'whole ' * ('int()' in complaint)}number, not {wanted[2]!r}"
    if choices := re.search(r"Expected one of \((.*)\)", complaint):
        names = sorted(name for name in re.findall(r"'([^']*)'", choices[1]) if name != "None")
        return f"{complaint[: choices.start()]}Expected one of {', '.join(names)}."
    return complaint


def _explain(error: Exception) -> tuple[str, int]:
    """One sentence and an exit code for anything a command raised."""
    if isinstance(error, UserError):
        return str(error), error.exit_code
    if isinstance(error, ModuleNotFoundError) and error.name in MISSING_PARTS:
        return MISSING_PARTS[error.name], 1
    if isinstance(error, OSError):
        return f"{error.strerror or error}: {error.filename}" if error.filename else str(error), 1
    return f"unexpected {type(error).__name__}: {error} (run again with {DEBUG_FLAG} to see where)", 1


def _say(sentence: str, code: int) -> int:
    print(f"{PROGRAM}{shortened(sentence, LONGEST_MESSAGE - len(PROGRAM))}", file=sys.stderr)
    return code
