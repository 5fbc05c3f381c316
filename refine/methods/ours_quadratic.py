"""The paper's energy: the MRF whose gradient term is quadratic, with parameters of its own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from refine.methods.ours import Ours
from stereoforge_kit.errors import InputError


@dataclass(frozen=True)
class OursQuadratic(Ours):
    """`ours` as the paper has it (Sec. 3.3), where validation may not make the gradient term robust."""

    name: ClassVar[str] = "ours_quadratic"
    label: ClassVar[str] = "Ours, quadratic as in the paper"
    search: ClassVar = {path: values for path, values in Ours.search.items() if path != "gradient_scale"}
    tied: ClassVar = tuple(pair for pair in Ours.tied if "gradient_scale" not in pair)

    def __post_init__(self) -> None:
        if self.gradient_scale is not None:
            raise InputError("the paper's energy has a quadratic gradient term, so no gradient_scale")
