"""`stereoforge app` before it serves: its address, and Gradio."""

from __future__ import annotations

import socket
import sys

import pytest

from stereoforge.cli import main


def refused(capsys: pytest.CaptureFixture[str], *flags: str) -> str:
    """The one sentence with which it ends."""
    with pytest.raises(SystemExit) as end:
        main(["app", *flags])
    assert end.value.code == 2
    (sentence,) = capsys.readouterr().err.splitlines()
    return sentence


def test_a_port_that_is_taken(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        said = refused(capsys, "--port", str(port))
    assert f"--port {port}: cannot listen there on 127.0.0.1 (Address already in use)" in said


def test_impossible_addresses(capsys: pytest.CaptureFixture[str]) -> None:
    assert "--port must lie between 0 and 65535, got 70000" in refused(capsys, "--port", "70000")
    assert "cannot listen there on 192.0.2.1" in refused(capsys, "--host", "192.0.2.1")
    assert "--host a b: is no address of this machine" in refused(capsys, "--host", "a b")


def test_without_gradio(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """The command names the extra; nothing else imports it."""
    monkeypatch.setitem(sys.modules, "gradio", None)
    assert "pip install 'stereoforge[app]'" in refused(capsys)
