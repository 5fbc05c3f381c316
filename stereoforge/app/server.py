"""Serve the page, on this machine alone unless another address is asked for."""

from __future__ import annotations

import os
import socket
from contextlib import closing
from pathlib import Path

from fastapi import FastAPI

from stereoforge.errors import UsageError
from stereoforge.pipelines.refiner import StereoRefiner

QUIET = {"GRADIO_ANALYTICS_ENABLED": "False", "HF_HUB_DISABLE_TELEMETRY": "1", "HF_HUB_OFFLINE": "1"}
"""What keeps Gradio and its libraries from reporting to anybody, or asking for a newer version."""
WAITING = 128
"""Connections that wait."""


def listening_socket(host: str, port: int) -> socket.socket:
    """A socket that listens there; port 0 takes a free one.

    Raises UsageError, with one sentence, for a port that is taken or not allowed, and an address of another machine.
    """
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
    except (socket.gaierror, UnicodeError) as error:
        raise UsageError(f"--host {host}: is no address of this machine") from error
    listening = socket.socket(family, kind, protocol)
    try:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind(address)
        listening.listen(WAITING)
    except OSError as error:
        listening.close()
        raise UsageError(
            f"--port {port}: cannot listen there on {host} ({error.strerror}); choose another one, or 0 for a free one"
        ) from error
    return listening


def page_server(refiner: StereoRefiner, folder: Path) -> FastAPI:
    """The page as an ASGI application.

    Args:
        refiner: What the page asks.
        folder: For uploads and results; whoever made it removes it.
    """
    os.environ.update(QUIET, GRADIO_TEMP_DIR=str(folder / "shown"))
    import gradio as gr

    from stereoforge.app.page import build_page, page_settings

    results = folder / "results"
    return gr.mount_gradio_app(FastAPI(), build_page(refiner, results), path="/", **page_settings(results))


def serve(app: FastAPI, listening: socket.socket) -> None:
    """Answer until interrupted."""
    import uvicorn

    with closing(listening):
        uvicorn.Server(uvicorn.Config(app, log_level="warning", timeout_graceful_shutdown=1)).run([listening])
