"""Kernels where the program's folder and the user's cache folder cannot be written, as in many containers."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
KERNEL = """
import sys, tempfile
tempfile.tempdir = sys.argv[1]
sys.path.insert(0, sys.argv[2])
from stereoforge_kit.kernels import njit

@njit()
def double(x):
    return 2 * x

print(double(21))
"""
WITHOUT_OVERRIDE = ("setpriv", "--bounding-set=-dac_override") if os.getuid() == 0 else ()
"""Root obeys the permissions of files only without this capability."""


def run(folder: Path, temporary: Path) -> subprocess.CompletedProcess[str]:
    """Run a kernel whose own folder and HOME cannot be written."""
    program = folder / "program.py"
    if not program.exists():
        program.write_text(KERNEL)
    folder.chmod(0o500)
    try:
        return subprocess.run(
            [*WITHOUT_OVERRIDE, sys.executable, program, temporary, ROOT],
            env={"HOME": str(folder), "PATH": os.environ["PATH"], "PYTHONDONTWRITEBYTECODE": "1"},
            capture_output=True,
            text=True,
            check=False,
        )
    finally:
        folder.chmod(0o700)


@pytest.fixture
def folders(tmp_path: Path) -> tuple[Path, Path]:
    read_only, temporary = tmp_path / "code", tmp_path / "tmp"
    read_only.mkdir()
    temporary.mkdir()
    return read_only, temporary


def test_the_cache_falls_back_to_the_temporary_folder(folders: tuple[Path, Path]) -> None:
    code, temporary = folders
    done = run(code, temporary)
    assert (done.returncode, done.stdout) == (0, "42\n"), done.stderr
    assert done.stderr.count("compiled code is kept in") == 1
    first = {path: path.stat().st_mtime_ns for path in temporary.rglob("*.nbc")}
    assert first
    assert run(code, temporary).stdout == "42\n"
    assert {path: path.stat().st_mtime_ns for path in temporary.rglob("*.nbc")} == first, "compiled again"


def test_kernels_compile_without_any_cache(folders: tuple[Path, Path]) -> None:
    code, temporary = folders
    temporary.chmod(0o500)
    done = run(code, temporary)
    assert (done.returncode, done.stdout) == (0, "42\n"), done.stderr
    assert done.stderr.count("compiled code is not kept") == 1


def test_a_cache_that_somebody_else_prepared_is_not_used(folders: tuple[Path, Path]) -> None:
    """Code in it would be run."""
    code, temporary = folders
    elsewhere = temporary.parent / "elsewhere"
    elsewhere.mkdir()
    (temporary / f"stereoforge-numba-{os.getuid()}").symlink_to(elsewhere)
    done = run(code, temporary)
    assert (done.returncode, done.stdout) == (0, "42\n"), done.stderr
    assert "compiled code is not kept" in done.stderr
    assert not any(elsewhere.iterdir())
