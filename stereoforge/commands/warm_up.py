"""`stereoforge warm-up`: compile now what the first pair and the first scene would wait for."""

from __future__ import annotations

from dataclasses import dataclass

from stereoforge.progress import console


@dataclass(frozen=True)
class WarmUp:
    """Compile the kernels of the refinement and of the scenes now, so that nothing waits for them later.

    They are compiled for this machine's processor and kept beside the program, or where NUMBA_CACHE_DIR says.
    """

    def run(self) -> None:
        """Compile, and say how long it took."""
        from stereoforge.pipelines.warming import warm_up

        console.print("compiling the kernels, once for this machine ...")
        for stage, seconds in warm_up():
            console.print(f"    {stage}: {seconds:.0f} s")
