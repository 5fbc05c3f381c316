"""A write is either there in whole or not at all."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np
import pytest

from datagen.formats import read_pfm, write_pfm
from stereoforge_kit.files import TEMPORARY_SUFFIX, replacing, write_text


def write_half(path: Path) -> None:
    with replacing(path) as temporary:
        temporary.write_text("half of the n")
        assert temporary.parent == path.parent
        assert temporary.name.startswith(".a.txt.")
        assert temporary.name.endswith(TEMPORARY_SUFFIX)
        raise KeyboardInterrupt


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    write_text(path, "old")
    with pytest.raises(KeyboardInterrupt):
        write_half(path)
    assert [item.name for item in tmp_path.iterdir()] == ["a.txt"]
    assert path.read_text() == "old"


def test_a_new_file_has_the_rights_of_any_other(tmp_path: Path) -> None:
    write_text(tmp_path / "a.txt", "x")
    (tmp_path / "plain.txt").write_text("x")
    assert (tmp_path / "a.txt").stat().st_mode == (tmp_path / "plain.txt").stat().st_mode


def test_text_is_utf8_with_unix_lines_and_folders_are_made(tmp_path: Path) -> None:
    write_text(tmp_path / "b" / "c" / "a.txt", "größer\n")
    assert (tmp_path / "b" / "c" / "a.txt").read_bytes() == b"gr\xc3\xb6\xc3\x9fer\n"


def test_a_reader_beside_a_writer_never_meets_half_a_file(tmp_path: Path) -> None:
    path = tmp_path / "a.pfm"
    write_pfm(path, np.zeros((300, 400)))
    stop = threading.Event()

    def keep_writing() -> None:
        value = 0
        while not stop.is_set():
            value = 1 - value
            write_pfm(path, np.full((300, 400), value))

    writers = [threading.Thread(target=keep_writing) for _ in range(2)]
    for writer in writers:
        writer.start()
    try:
        seen = {float(value) for _ in range(200) for value in [np.ptp(read_pfm(path))]}
    finally:
        stop.set()
        for writer in writers:
            writer.join()
    assert seen == {0.0}
    assert [item.name for item in tmp_path.iterdir()] == ["a.pfm"]
