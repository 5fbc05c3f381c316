"""The gap between domains in numbers: what a regressor loses in another one, and what wins it back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from refine.evaluation.results import EvaluatedSet, null_nan

NAN = float("nan")
MEASURES = {"epe_all": "EPE, px", "bad_all": "> 1 px, %", "gradient_masked": "gradient error, smooth"}
"""What the gap is measured in."""
SUMMARY = {"bad1": "bad_all", "epe": "epe_all", "gradient": "gradient_masked"}
"""Names in summary.json; bad1 is a share 0..1 of pixels off by more than 1 px."""


@dataclass(frozen=True)
class Gap:
    """One measure on one test domain, for the subject's networks."""

    domain: str
    measure: str
    cross: float
    """The error of the subject's regressor there."""
    home: float
    """The error of the domain's own regressor; NaN where none was trained."""
    refined: float
    true_confidence: float
    fine_tuned: float

    @property
    def size(self) -> float:
        """How much larger the error is than that of the domain's own regressor."""
        return self.cross - self.home

    def share(self, error: float) -> float:
        """How much of the gap is closed by what leaves `error`: 0 nothing, 1 all; NaN where there is no gap."""
        return (self.cross - error) / self.size if self.size > 0 else NAN

    @property
    def shares(self) -> dict[str, float]:
        """By what closes it."""
        return {
            "refinement": self.share(self.refined),
            "refinement, true confidence": self.share(self.true_confidence),
            "fine-tuning on the domain": self.share(self.fine_tuned),
        }


def gaps(
    subject: str,
    tests: tuple[str, ...],
    cells: Mapping[tuple[str, str], EvaluatedSet],
    fine_tuned: Mapping[str, EvaluatedSet],
) -> list[Gap]:
    """The gaps of all test domains but the subject's own.

    Args:
        cells: (trained on, tested on) to the evaluation.
        fine_tuned: Test domain to the evaluation of the subject's regressor fine-tuned on it.
    """
    return [
        Gap(
            domain=test,
            measure=measure,
            cross=error_of(cells.get((subject, test)), "regressor", measure),
            home=error_of(cells.get((test, test)), "regressor", measure),
            refined=error_of(cells.get((subject, test)), "ours", measure),
            true_confidence=error_of(cells.get((subject, test)), "ours_conf_gt", measure),
            fine_tuned=error_of(fine_tuned.get(test), "regressor", measure),
        )
        for test in tests
        if test != subject
        for measure in MEASURES
    ]


def error_of(evaluated: EvaluatedSet | None, method: str, measure: str) -> float:
    """NaN where the method was not run."""
    if evaluated is None or method not in evaluated.evaluation.scores:
        return NAN
    return evaluated.evaluation.scores[method].measures()[measure]


def summary(
    subject: str, tests: tuple[str, ...], cells: Mapping[tuple[str, str], EvaluatedSet]
) -> dict[str, dict[str, dict[str, float | None]]]:
    """{domain: {method: {bad1, epe, gradient}}} of the subject's networks; null for what a method does not give."""
    return {
        test: {
            method: {
                name: null_nan(error_of(cells[subject, test], method, key)) for name, key in SUMMARY.items()
            }
            for method in cells[subject, test].evaluation.scores
        }
        for test in tests
    }


def gaps_document(found: list[Gap]) -> list[dict[str, Any]]:
    """Plain records, NaN as null."""
    return [
        {
            "domain": gap.domain,
            "measure": gap.measure,
            **{
                name: null_nan(getattr(gap, name))
                for name in ("cross", "home", "refined", "true_confidence", "fine_tuned")
            },
            "closed": {name: null_nan(share) for name, share in gap.shares.items()},
        }
        for gap in found
    ]
