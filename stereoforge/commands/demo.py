"""`stereoforge demo`: all of it, small, in minutes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

from stereoforge.bundled_weights import BUNDLED_WEIGHTS
from stereoforge.inputs.flag_values import shown
from stereoforge.places import check_writable, keep_apart
from stereoforge.progress import console


@dataclass(frozen=True)
class Demo:
    """Render a small training and test set, train the three networks, refine, evaluate, and write a report.

    Run it again to continue where it stopped.
    """

    interrupted: ClassVar[str] = "the same command run again continues where it stopped"

    out: Annotated[Path, shown("DIR")] = Path("demo")
    """Folder for everything."""
    device: Annotated[str, shown("NAME")] = "auto"
    """What the networks run on: auto (cuda where there is such a GPU, else cpu), cpu, cuda, cuda:1 or mps."""

    def run(self) -> None:
        """Run every stage and print the main numbers and where the report is."""
        keep_apart("--out", self.out, "the bundled weights", BUNDLED_WEIGHTS)
        check_writable("--out", self.out)
        from stereoforge.pipelines.demo import run_demo, summary_table

        result = run_demo(self.out, device=self.device)
        console.print(summary_table(result.evaluation, "networks trained just now"))
        console.print(summary_table(result.bundled, "bundled weights, same frames"))
        console.print("where the time went:")
        for title, seconds in result.seconds.items():
            console.print(f"  {seconds:5.0f} s  {title}", markup=False)
        console.print(
            f"Made in {result.minutes:.1f} minutes: a toy by its training, the real thing in every step.\n"
            f"  pictures of the data set   {result.gallery}\n"
            f"  report of the evaluation   {result.report}\n"
            f"  the data set               {result.data}\n"
            f"  the networks               {result.weights}",
        )
