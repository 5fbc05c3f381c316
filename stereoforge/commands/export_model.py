"""`stereoforge export-model`: trained networks for programs without torch."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from stereoforge.inputs.flag_values import shown
from stereoforge.progress import console


@dataclass(frozen=True)
class ExportModel:
    """Write the networks of a run folder as one ONNX file, checked with onnxruntime against torch.

    It takes `left` and `right` (B, 3, H, W) in 0..1, sides multiples of 64, of any such size, and gives `disparity`
    (B, 1, H, W) and, where the folder has the networks, `confidence` (B, 1, H, W) and `gradient` (B, 2, H, W).
    """

    run_folder: Annotated[tyro.conf.Positional[Path], shown("RUN")]
    """Run folder of the networks."""
    out: Annotated[Path, shown("DIR")]
    """Folder for stereoforge.onnx and the model card."""
    device: Annotated[str, shown("NAME")] = "auto"
    """What torch computes on to compare: auto (cuda where there is such a GPU, else cpu), cpu, cuda, cuda:1 or mps."""

    def run(self) -> None:
        """Write the ONNX file and compare its results with torch's."""
        from training.prediction.onnx_export import export_model
        from training.runs.model_card import write_model_card

        exported = export_model(self.run_folder, self.out, self.device)
        write_model_card(self.run_folder, self.out)
        console.print(
            f"{exported.path}: {', '.join(exported.outputs)}; onnxruntime agrees with torch to "
            f"{exported.largest_difference:.1g}",
            markup=False,
        )
