"""`stereoforge study`: train on some domains, test on others, and say what closes the gap between them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from scenes import FAMILIES
from stereoforge.errors import UsageError
from stereoforge.inputs.flag_values import parse_counts, parse_methods, parse_size, shown
from stereoforge.places import check_writable, keep_apart
from stereoforge.progress import console

if TYPE_CHECKING:
    from stereoforge.study import StudyPlan


@dataclass(frozen=True)
class Study:
    """The domain-gap study: render what is missing, train what is missing, evaluate all, report.

    Domains are families of worlds, or data sets that are there. Run it again to continue, or with other flags to
    extend it: every step has a folder named by all that decides its result, and is done once. OUT/results holds the
    report, the tables, the gap and summary.json.
    """

    interrupted: ClassVar[str] = "the same command run again continues where it stopped"

    out: Annotated[Path, shown("DIR")]
    """Folder for everything."""
    train: Annotated[tuple[str, ...], shown("DOMAIN", "the plan's")] = ()
    """Domains to train on. The first is the subject of the study; the others give the errors in their own domain."""
    test: Annotated[tuple[str, ...], shown("DOMAIN", "the plan's")] = ()
    """Domains to test on."""
    plan: Annotated[Path | None, shown("FILE", "none")] = None
    """A plan.yaml that says it all, instead of the flags."""
    preset: Literal["tiny", "small", "full"] = "small"
    """Of all networks."""
    size: Annotated[str, shown("WxH")] = "384x192"
    """Image size of what is rendered, in pixels."""
    scenes: Annotated[str, shown("COUNTS")] = "train=100,val=5,test=25"
    """Scenes of each split of each family."""
    frames_per_scene: Annotated[int, shown("N")] = 4
    """Frames in each scene."""
    steps: Annotated[str, shown("COUNTS", "the preset's")] = ""
    """Training steps, for example regressor=8000,confnet=1000,gradnet=1000,regressor_f=500."""
    fine_tuning_steps: Annotated[int, shown("N")] = 0
    """Steps of the subject's regressor on each other domain; 0 leaves that out."""
    tuning_frames: Annotated[int, shown("N")] = 0
    """Validation frames to choose the methods' parameters on; 0 takes the defaults."""
    methods: Annotated[str, shown("LIST", "all there are")] = ""
    """Rows of the subject's tables, comma-separated."""
    seed: Annotated[int, shown("N")] = 0
    """Everything random follows from it."""
    device: Annotated[str, shown("NAME")] = "auto"
    """What the networks run on: auto (cuda where there is such a GPU, else cpu), cpu, cuda, cuda:1 or mps."""

    def run(self) -> None:
        """Run every step that is not done yet, then write the results."""
        plan = self._plan()
        for domain in plan.domains.values():
            keep_apart("--out", self.out, "the domain", domain.source)
        check_writable("--out", self.out)
        from stereoforge.study import run_study
        from training.devices import parse_device

        parse_device(self.device)  # before hours of rendering
        result = run_study(plan, self.out, device=self.device)
        for gap in result.gaps:
            shares = ", ".join(f"{name} {share:.0%}" for name, share in gap.shares.items() if share == share)
            if shares:
                console.print(f"{gap.domain}, {gap.measure}: of a gap of {gap.size:.3g}, {shares}")
        console.print(f"{result.report}")

    def _plan(self) -> StudyPlan:
        from stereoforge.study import DomainPlan, StudyPlan, read_plan

        if self.plan is not None:
            defaults = Study(self.out, plan=self.plan, device=self.device)
            if self != defaults:
                raise UsageError("--plan says it all: besides it only --out and --device may be given")
            return read_plan(self.plan)
        domains = {}
        for name in (*self.train, *self.test):
            family = name in FAMILIES
            domains[name] = DomainPlan(
                source=None if family else name,
                config={"frames": self.frames_per_scene} if family else {},
                scenes=parse_counts("--scenes", self.scenes, ("train", "val", "test")),
                steps=parse_counts("--steps", self.steps, ("regressor", "regressor_f", "confnet", "gradnet")),
            )
        return StudyPlan(
            domains=domains,
            train=self.train,
            test=self.test,
            size=parse_size(self.size),
            seed=self.seed,
            preset=self.preset,
            fine_tuning_steps=self.fine_tuning_steps,
            tuning_frames=self.tuning_frames,
            methods=parse_methods(self.methods),
        )
