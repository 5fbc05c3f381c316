"""Freed memory is kept and given back, as the system counts it."""

import subprocess
import sys

import pytest

FAULTS = """
import resource, sys
import numpy as np
from stereoforge_kit.allocation import keep_freed_memory

if sys.argv[1] == "keep":
    assert keep_freed_memory()

def use():
    np.ones(8_000_000)

use()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(5):
    use()
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="other C libraries are not told")
def test_the_same_pages_are_used_again() -> None:
    """64 MB are 15,625 pages; without it each array is made of new ones."""
    asked, kept = (
        int(subprocess.run([sys.executable, "-c", FAULTS, word], check=True, capture_output=True).stdout)
        for word in ("ask", "keep")
    )
    assert kept < 200 < asked


RESIDENT = """
import re
from pathlib import Path
import numpy as np
from stereoforge_kit.allocation import give_back_freed_memory, keep_freed_memory

def megabytes():
    return int(re.search(r"VmRSS:\\s*(\\d+)", Path("/proc/self/status").read_text())[1]) // 1024

assert keep_freed_memory()
before = megabytes()
arrays = [np.ones(1_000_000) for _ in range(20)]
del arrays
kept = megabytes()
give_back_freed_memory()
print(kept - before, megabytes() - before)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="other C libraries are not told")
def test_kept_memory_is_given_back() -> None:
    """Of 160 MB."""
    words = subprocess.run([sys.executable, "-c", RESIDENT], check=True, capture_output=True).stdout.split()
    kept, left = map(int, words)
    assert kept > 140
    assert left < 20
