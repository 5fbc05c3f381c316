"""One worker process, supervised from outside: its time, memory, end and output.

Each worker has a pipe of its own and shares no lock with anyone, so that it can be killed at any moment
without harm to the others. It dies with the process that started it.
"""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import faulthandler
import multiprocessing
import os
import pickle
import resource
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from multiprocessing.reduction import DupFd
from pathlib import Path
from typing import Any, Literal

from stereoforge_kit.errors import UserError
from stereoforge_kit.processes.limits import Limits

POLL_S = 0.1
"""How often a watched process's memory should be looked at."""
START_TIMEOUT_S = 900.0
"""A process that has not come up and imported what it needs by then never will."""
OUTPUT_BYTES_KEPT = 1 << 18
HEADROOM_BYTES = 1 << 30
"""Address space granted beyond the limit of resident memory: stacks, arenas and buffers nobody touches."""

FailureKind = Literal["crash", "killed", "timeout", "memory", "environment"]
_PR_SET_PDEATHSIG = 1
_BEGUN = "begun"
_NAME = "stereoforge-worker"
_NO_MAIN_GUARD = 97
"""The exit code of a process that was to import the calling script and was asked to start processes by it."""
_SIGNALS_FROM_OUTSIDE = (signal.SIGKILL, signal.SIGTERM, signal.SIGHUP)

_capture: Path | None = None


class WorkerError(UserError):
    """A worker process ended, or was ended, before it gave a result; the message is one sentence."""

    def __init__(self, kind: FailureKind, sentence: str) -> None:
        super().__init__(sentence)
        self.kind = kind
        """`killed`: by someone outside, so probably through no fault of the call; `environment`: the process never
        came up, through no fault of the call either."""

    def __reduce__(self) -> tuple[type[WorkerError], tuple[FailureKind, str]]:
        return WorkerError, (self.kind, str(self))


@dataclass(frozen=True)
class _Returned:
    value: Any


@dataclass(frozen=True)
class _Raised:
    error: BaseException


class _Inherited:
    """A file descriptor for a process that is being spawned, there an open one of its own.

    The duplicate is made while the process is spawned, as multiprocessing does for its connections. Made before,
    `DupFd` would open a socket in the folder for temporary files, which stays there if this process is killed.
    """

    def __init__(self, descriptor: int) -> None:
        self.descriptor = descriptor

    def __reduce__(self) -> tuple[Callable[[Any], int], tuple[Any]]:
        return _detach, (DupFd(self.descriptor),)


def _detach(duplicate: Any) -> int:
    return int(duplicate.detach())


def captured_output() -> Path | None:
    """The file that takes everything this process prints, if this is a worker process."""
    return _capture


def check_main_guard() -> None:
    """End this process if it is a worker that has not come up yet: a script without a main guard asks it for work.

    A spawned process imports the calling script. The process that waits for this one says what is wrong.
    """
    process = multiprocessing.current_process()
    if process.name == _NAME and getattr(process, "_inheriting", False):
        raise SystemExit(_NO_MAIN_GUARD)


class WorkerProcess:
    """A spawned process that makes one call at a time.

    `start` a call, ask `poll` (every `POLL_S`, waiting on `waitables` meanwhile) until it has ended, take
    the `result`; then start the next one, unless the process is no longer `alive`.
    """

    def __init__(self, limits: Limits | None = None, environment: Mapping[str, str] | None = None) -> None:
        """environment: variables for the process, there before it imports anything."""
        check_main_guard()
        self.limits = limits or Limits()
        self._output = tempfile.TemporaryFile()  # noqa: SIM115  (lives as long as the worker; has no name)
        context = multiprocessing.get_context("spawn")
        self._connection, theirs = context.Pipe()
        self._process: BaseProcess = context.Process(
            target=_serve,
            args=(theirs, _Inherited(self._output.fileno()), os.getpid(), self.limits),
            name=_NAME,
        )
        with _variables(environment or {}):
            self._process.start()
        theirs.close()
        atexit.register(
            self.stop
        )  # At exit multiprocessing waits for its children, and ours waits for calls.
        self._deadline = 0.0
        self._began_at: float | None = None
        self._end: _Returned | _Raised | None = None

    @property
    def begun(self) -> bool:
        """Whether the process has come up, imported what the last call needs and begun it."""
        return self._began_at is not None

    @property
    def ran_s(self) -> float:
        """Seconds since the last call was begun; 0 if it has not been."""
        return 0.0 if self._began_at is None else time.monotonic() - self._began_at

    @property
    def alive(self) -> bool:
        """Whether the process takes another call."""
        return self._process.is_alive()

    @property
    def pid(self) -> int:
        """The process's number."""
        assert self._process.pid is not None
        return self._process.pid

    @property
    def waitables(self) -> list[Connection | int]:
        """What becomes ready when the call ends, for `multiprocessing.connection.wait`."""
        return [self._connection, self._process.sentinel]

    def start(self, function: Callable[..., Any], *args: Any) -> None:
        """Begin a call. Raises what pickling the function or its arguments raises."""
        self._end = self._began_at = None
        self._output.truncate(0)
        self._deadline = time.monotonic() + START_TIMEOUT_S + self.limits.timeout_s
        try:
            self._connection.send((function, args))
        except OSError:
            self._end = self._death()

    def poll(self) -> bool:
        """Whether the call has ended. Ends the process if it is over its limits."""
        while self._end is None and self._connection.poll():
            self._receive()
        if self._end is not None:
            return True
        if not self.alive:
            self._end = self._death()
        elif time.monotonic() > self._deadline:
            self._end = self._ended("timeout", f"ran longer than its limit of {self.limits.timeout_s:g} s")
        elif self.limits.memory_bytes and (used := self.resident_bytes()) > self.limits.memory_bytes:
            self._end = self._ended("memory", _over_memory(used, self.limits.memory_bytes))
        return self._end is not None

    def result(self) -> Any:
        """What the ended call returned. Raises what it raised, or WorkerError."""
        if isinstance(self._end, _Returned):
            return self._end.value
        assert self._end is not None, "the call has not ended"
        raise self._end.error

    def output(self) -> str:
        """The end of what the last call printed, Python's trace of a crash included."""
        self._output.seek(max(0, os.fstat(self._output.fileno()).st_size - OUTPUT_BYTES_KEPT))
        return self._output.read().decode("utf-8", errors="replace")

    def resident_bytes(self) -> int:
        """The memory the process holds; 0 when it is gone."""
        try:
            pages = Path(f"/proc/{self.pid}/statm").read_text().split()[1]
        except (OSError, IndexError):
            return 0
        return int(pages) * resource.getpagesize()

    def stop(self) -> None:
        """End the process at once, whatever it is doing, and wait until it is gone."""
        atexit.unregister(self.stop)
        self._process.kill()
        self._process.join()
        self._connection.close()
        self._output.close()

    def _receive(self) -> None:
        try:
            message = self._connection.recv()
        except (EOFError, OSError):
            self._end = self._death()
            return
        if message == _BEGUN:
            self._began_at = time.monotonic()
            self._deadline = self._began_at + self.limits.timeout_s
        else:
            self._end = message
            self._check_memory_error()

    def _check_memory_error(self) -> None:
        """An allocation refused by the process's limit is that limit, not a fault of the call's own."""
        if isinstance(self._end, _Raised) and isinstance(self._end.error, MemoryError):
            sentence = f"could not allocate memory within its limit ({self._end.error})"
            self._end = _Raised(WorkerError("memory", sentence))

    def _ended(self, kind: FailureKind, sentence: str) -> _Raised:
        self._process.kill()
        self._process.join()
        return _Raised(WorkerError(kind, sentence))

    def _death(self) -> _Raised:
        self._process.join(5.0)
        code = self._process.exitcode
        if code is None:
            return self._ended("crash", "its process closed the connection without an answer")
        if code >= 0 and not self.begun:
            return _Raised(WorkerError("environment", _never_came_up(code)))
        if code >= 0:
            return _Raised(WorkerError("crash", f"its process ended with exit code {code}"))
        name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
        if -code in _SIGNALS_FROM_OUTSIDE:
            return _Raised(WorkerError("killed", f"its process was killed from outside ({name})"))
        return _Raised(WorkerError("crash", f"its process crashed ({name})"))


def _never_came_up(code: int) -> str:
    if code == _NO_MAIN_GUARD:
        return (
            "worker processes import the calling script, which has no main guard: put what it does behind "
            'if __name__ == "__main__":'
        )
    return (
        f"a worker process ended with exit code {code} while it imported the calling script, before its first call; "
        "the reason is printed above"
    )


def _over_memory(used: int, limit: int) -> str:
    return f"used {used / 2**20:.0f} MiB, more than its limit of {limit / 2**20:.0f} MiB"


@contextlib.contextmanager
def _variables(changes: Mapping[str, str]) -> Iterator[None]:
    """These environment variables meanwhile, for a process that is started now."""
    before = {name: os.environ.get(name) for name in changes}
    os.environ.update(changes)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _serve(connection: Connection, output: int, parent: int, limits: Limits) -> None:
    """The worker's side: calls as they come, until the other side is gone."""
    _die_with(parent)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent to handle.
    _capture_output(output)
    _limit_address_space(limits)
    while True:
        try:
            function, args = connection.recv()  # Imports what the call needs; its time starts after that.
            connection.send(_BEGUN)
            answer: _Returned | _Raised = _Returned(function(*args))
        except (EOFError, KeyboardInterrupt):
            return
        except BaseException as error:
            traceback.print_exc()
            answer = _Raised(_portable(error))
        sys.stdout.flush()
        sys.stderr.flush()
        try:
            connection.send(answer)
        except OSError:
            return
        except Exception as error:
            connection.send(_Raised(TypeError(f"the result cannot be sent back: {error}")))


def _die_with(parent: int) -> None:
    """Ask Linux to kill this process when the one that started it is gone, however that ended."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != parent:  # It was gone before we asked.
        os._exit(1)


def _capture_output(descriptor: int) -> None:
    """Send what this process and the C code in it print, and the trace of a crash, to the parent's file."""
    global _capture
    _capture = Path(f"/proc/self/fd/{descriptor}")
    appending = os.open(_capture, os.O_WRONLY | os.O_APPEND)
    for standard in (1, 2):
        os.dup2(appending, standard)
    faulthandler.enable(file=appending)


def _limit_address_space(limits: Limits) -> None:
    """A second line behind the parent's watch, for one huge allocation; and no core files."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    if limits.memory_bytes:
        size = limits.memory_bytes + HEADROOM_BYTES
        resource.setrlimit(resource.RLIMIT_DATA, (size, size))


def _portable(error: BaseException) -> BaseException:
    """The error itself if it survives the journey to the parent, else its words."""
    try:
        copy = pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error if type(copy) is type(error) else RuntimeError(f"{type(error).__name__}: {error}")
