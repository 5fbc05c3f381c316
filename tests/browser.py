"""Chromium without a window, on a page whose script writes what it finds as FACTS{...}END."""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


def run_browser(address: str, profile: Path, *flags: str, timeout_s: float = 120) -> dict[str, Any]:
    """The facts of the page at an address, once it and all that it loads are there.

    Args:
        address: URL.
        profile: Folder of the browser's own files.
        flags: More of Chromium's.
        timeout_s: After which it fails.
    """
    command = [
        str(CHROMIUM),
        *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
        *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
        f"--user-data-dir={profile}",
        *flags,
        *("--dump-dom", address),
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=timeout_s)
    found = re.search(r"FACTS(.*)END", done.stdout, re.DOTALL)
    assert found, done.stderr[-500:]
    return json.loads(html.unescape(found[1]))
