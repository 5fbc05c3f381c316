"""`stereoforge check`: is a pair rectified, which way round, and how do its views differ?"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro
from rich.table import Table

from stereoforge.errors import CommandError, UsageError
from stereoforge.inputs.flag_values import shown
from stereoforge.inputs.images import pair_doubts, read_color_images
from stereoforge.places import check_writable, keep_apart
from stereoforge.progress import console, remark
from stereoforge_kit.files import write_text

if TYPE_CHECKING:
    from datagen.cameras.calibration import Calibration
    from stereoforge.pipelines.pair_check import PairCheck


@dataclass(frozen=True)
class Check:
    """Say whether a pair is rectified, which view is the left one, and how their exposures differ.

    By the points that both pictures show. Exit code 0 whatever the verdict, 1 if nothing can be said.
    """

    left: Annotated[tyro.conf.Positional[Path], shown("LEFT")]
    """Left picture (PNG, JPEG, TIFF, ...)."""
    right: Annotated[tyro.conf.Positional[Path], shown("RIGHT")]
    """Right picture."""
    calibration: Annotated[str | None, shown("FILE", "none")] = None
    """Calibration of the rectified pair, for depths, and for principal points that differ."""
    json: Annotated[Path | None, shown("FILE", "none")] = None
    """Also write the figures, as JSON."""
    out: Annotated[Path | None, shown("FILE.png", "none")] = None
    """Also write a picture of the matches, coloured by their vertical offset."""

    def run(self) -> None:
        """Check the pair and say what was found."""
        self._check()
        left, right, remarks = read_color_images(self.left, self.right)
        for sentence in remarks:
            remark(sentence)
        plain = [doubt for doubt in pair_doubts(left, right) if "the same" not in doubt]
        if plain:
            raise CommandError(f"nothing can be said: {plain[0]}")
        from stereoforge.pipelines.pair_check import check_pair

        calibration = self._calibration()
        try:
            found = check_pair(left, right, calibration)
        except ValueError as error:
            raise CommandError(f"{self.calibration}: {error}") from error
        if self.json is not None:
            write_text(self.json, json.dumps(found.as_json(), indent=2) + "\n")
        if self.out is not None:
            from datagen.formats import write_png
            from stereoforge.pipelines.pair_check_picture import check_picture

            write_png(self.out, check_picture(left, found))
        self._say(found)

    def _check(self) -> None:
        for flag, written in (("--json", self.json), ("--out", self.out)):
            if written is None:
                continue
            if written.is_dir():
                raise UsageError(f"{flag} {written} is a folder; it takes the file to write")
            for source_flag, source in (
                ("LEFT", self.left),
                ("RIGHT", self.right),
                ("--calibration", self.calibration),
            ):
                keep_apart(flag, written, source_flag, source)
            check_writable(flag, written.parent)
        if self.out is not None and self.out.suffix.lower() != ".png":
            raise UsageError(f"--out {self.out}: writes a PNG file, so its name ends in .png")
        if self.out is not None and self.out == self.json:
            raise UsageError("--json and --out are two files")

    def _calibration(self) -> Calibration | None:
        if self.calibration is None:
            return None
        from datagen.cameras.registry import read_calibration

        return read_calibration(self.calibration)

    def _say(self, found: PairCheck) -> None:
        console.print(f"{self.left}, {self.right}: {_headline(found)}", soft_wrap=True)
        table = Table(box=None, show_header=False, pad_edge=False)
        for name, value in _figures(found):
            table.add_row(name, value)
        console.print(table)
        for sentence in _advice(found):
            console.print(sentence, soft_wrap=True)


def _headline(found: PairCheck) -> str:
    order = {
        "left first": "the left view first",
        "swapped": "the views are swapped",
        "unclear": "which view is the left one is unclear",
    }[found.order]
    if found.verdict == "unrelated":
        return "unrelated pictures: no set of points that both show"
    if found.verdict == "the same picture":
        return "twice the same picture"
    return f"{found.verdict}, {order}"


def _figures(found: PairCheck) -> list[tuple[str, str]]:
    width, height = found.size
    lines = [("size", f"{width}x{height} px")]
    rows, span, share = found.rows, found.disparity_range, found.positive_share
    if found.matched or rows is not None:
        lines.append(("matches", f"{len(found.matches)} of {found.matched} agree with one another"))
    if rows is not None and span is not None and share is not None:
        lines += [
            (
                "vertical offset",
                f"{rows.median_px:+.2f} px in the median, spread {rows.spread_px:.2f} px, up to {rows.worst_px:.2f} px "
                "in a part of the picture",
            ),
            (
                "of that",
                f"shift {rows.shift_px:+.2f} px, roll {math.degrees(rows.roll_rad):+.3f}°, scale "
                f"{100 * rows.scale:+.3f} %",
            ),
            ("disparities", f"{span[0]:.1f} to {span[1]:.1f} px, {share:.0%} of them positive"),
        ]
    if (depths := found.depth_range_m) is not None:
        far = "infinity" if math.isinf(depths[1]) else f"{depths[1]:.3g} m"
        lines.append(("depths", f"{depths[0]:.3g} m to {far}"))
    if found.difference is not None:
        pixel_values, light = found.difference.pixel_values, found.difference.light
        red, green, blue = (100 * (ratio - 1) for ratio in found.difference.channels)
        lines += [
            (
                "exposure",
                f"right view {100 * (pixel_values - 1):+.1f} % in pixel values, {100 * (light - 1):+.1f} % in light "
                f"({math.log2(light):+.2f} stops)",
            ),
            ("colour", f"right view red {red:+.1f} %, green {green:+.1f} %, blue {blue:+.1f} %"),
        ]
    return lines


def _advice(found: PairCheck) -> list[str]:
    """What to do about it, a sentence each."""
    from stereoforge.pipelines.pair_check import DIFFERENT, RECTIFIED_PX, corrections, left_over_px

    advice = []
    if steps := corrections(found):
        advice.append(
            f"To correct the right picture: {', '.join(steps)}. With a calibration: stereoforge rectify."
        )
    if (
        found.verdict in ("nearly rectified", "not rectified")
        and (left := left_over_px(found)) > RECTIFIED_PX
    ):
        advice.append(
            f"Shift, roll and scale leave {left:.2f} px in a part of the picture, which only a calibration "
            "(stereoforge rectify) corrects."
        )
    if found.order == "swapped":
        advice.append("The disparities are negative: give the pictures the other way round.")
    if found.order == "unclear" and found.rows is not None and found.verdict != "the same picture":
        advice.append(
            "Disparities of both signs: the cameras' axes meet, or their principal points differ; --calibration tells."
        )
    if found.max_disparity is not None:
        advice.append(f"For refine: --max-disparity {found.max_disparity}")
    if found.difference is not None:
        off = [abs(ratio - 1) for ratio in (found.difference.pixel_values, *found.difference.channels)]
        if max(off) > DIFFERENT:
            advice.append(
                "The views differ in exposure or colour; matching by census or networks bears it best."
            )
    return advice
