"""The numbers printed in the paper, to be read beside ours.

They were measured on other data with a much larger network, so only their ratios to the regressor's row
compare. Tables 1-6 of Cheng, He, Zhang, "Learning to refine depth for robust stereo estimation", Pattern
Recognition 74, 2018. Shares are 0..1 here and per cent in print.
"""

from __future__ import annotations

from dataclasses import dataclass

NAN = float("nan")


@dataclass(frozen=True)
class PaperScore:
    """One row of the paper on one data set; NaN where it prints nothing."""

    bad_all: float = NAN
    epe_all: float = NAN
    bad_occ: float = NAN
    epe_occ: float = NAN
    gradient: float = NAN
    """Gradient error; its printed values are only plausible over pixels of smooth ground truth."""
    seconds: float = NAN
    """Of the refinement alone, on the authors' machine (Table 5)."""
    d1_bg: float = NAN
    d1_fg: float = NAN
    d1_all: float = NAN

    def value(self, measure: str) -> float:
        """By the name of a measure of ours; NaN for those the paper does not have."""
        found: float = getattr(self, {"gradient_masked": "gradient"}.get(measure, measure), NAN)
        return found


PAPER: dict[str, dict[str, PaperScore]] = {
    "FlyingThings3D test": {
        "regressor": PaperScore(0.2348, 2.16, 0.5308, 4.57, 0.55),
        "wmf": PaperScore(0.2157, 1.98, 0.4766, 4.02, 0.47),
        "regressor_f": PaperScore(0.2167, 2.10, 0.4978, 4.73, 0.47),
        "ours": PaperScore(0.2117, 1.98, 0.4653, 3.98, 0.38),
        "gradnet": PaperScore(gradient=0.05),
    },
    "FlyingThings3D validation": {
        "regressor": PaperScore(0.2499, 2.01, 0.5429, 4.70, 0.55),
        "wmf": PaperScore(0.2311, 1.84, 0.4891, 4.15, 0.47),
        "regressor_f": PaperScore(0.2324, 2.07, 0.5123, 4.79, 0.47),
        "ours": PaperScore(0.2273, 1.81, 0.4774, 4.08, 0.38, seconds=14.3),
        "gradnet": PaperScore(gradient=0.06),
        "color": PaperScore(bad_all=0.2254, epe_all=2.04, gradient=0.43, seconds=13.6),
        "tgv": PaperScore(bad_all=0.2237, epe_all=1.82, gradient=0.39, seconds=148.5),
        "fbs": PaperScore(bad_all=0.2331, epe_all=1.83, gradient=0.53, seconds=0.7),
        "grad": PaperScore(bad_all=0.2292, epe_all=1.99, gradient=0.42, seconds=2.5),
    },
    "Driving": {
        "regressor": PaperScore(bad_all=0.7050, epe_all=12.56, gradient=0.71),
        "wmf": PaperScore(bad_all=0.7018, epe_all=12.54, gradient=0.75),
        "regressor_f": PaperScore(bad_all=0.6892, epe_all=13.57, gradient=0.67),
        "ours": PaperScore(bad_all=0.7049, epe_all=12.35, gradient=0.60),
        "ours_conf_gt": PaperScore(bad_all=0.6336, epe_all=12.21),
        "gradnet": PaperScore(gradient=0.32),
    },
    "Monkaa": {
        "regressor": PaperScore(bad_all=0.3695, epe_all=10.92, gradient=0.45),
        "wmf": PaperScore(bad_all=0.3648, epe_all=10.86, gradient=0.44),
        "regressor_f": PaperScore(bad_all=0.3700, epe_all=10.84, gradient=0.42),
        "ours": PaperScore(bad_all=0.3573, epe_all=10.81, gradient=0.32),
        "ours_conf_gt": PaperScore(bad_all=0.2550, epe_all=10.97),
        "gradnet": PaperScore(gradient=0.09),
    },
    "Sintel": {
        "regressor": PaperScore(bad_all=0.4696, epe_all=5.74, gradient=0.45),
        "wmf": PaperScore(bad_all=0.4621, epe_all=5.65, gradient=0.40),
        "regressor_f": PaperScore(bad_all=0.4441, epe_all=7.31, gradient=0.47),
        "ours": PaperScore(bad_all=0.4633, epe_all=5.49, gradient=0.32),
        "ours_conf_gt": PaperScore(bad_all=0.3547, epe_all=4.99),
        "gradnet": PaperScore(gradient=0.10),
        "color": PaperScore(bad_all=0.4670, epe_all=5.65, gradient=0.36),
        "tgv": PaperScore(bad_all=0.4603, epe_all=5.59, gradient=0.36),
        "fbs": PaperScore(bad_all=0.4784, epe_all=5.78, gradient=0.47),
        "grad": PaperScore(bad_all=0.4642, epe_all=5.51, gradient=0.38),
    },
    "KITTI 2015": {
        "regressor": PaperScore(d1_bg=0.0432, d1_fg=0.0441, d1_all=0.0434),
        "ours": PaperScore(d1_bg=0.0439, d1_fg=0.0459, d1_all=0.0443),
    },
}
"""By data set, then by method."""

SAME_IN_PAPER = {"ours_quadratic": "ours"}
"""Rows of ours whose counterpart has another name in the paper."""

KITTI_OTHERS: dict[str, PaperScore] = {
    "Displets": PaperScore(d1_bg=0.0300, d1_fg=0.0556, d1_all=0.0343),
    "Content-CNN": PaperScore(d1_bg=0.0373, d1_fg=0.0858, d1_all=0.0454),
    "MC-CNN-acrt": PaperScore(d1_bg=0.0289, d1_fg=0.0888, d1_all=0.0389),
    "SPS-St": PaperScore(d1_bg=0.0384, d1_fg=0.1267, d1_all=0.0531),
}
"""Table 6's rows of other people's methods, by their names."""

_FLYING = ("flying_things", "flyingthings3d")
_COUNTERPARTS = {
    "driving": "Driving",
    "monkaa": "Monkaa",
    "sintel": "Sintel",
    "kitti": "KITTI 2015",
    "kitti2012": "KITTI 2015",
    "kitti2015": "KITTI 2015",
}


def counterpart(family: str, split: str, table: int) -> str | None:
    """The paper's data set (a key of `PAPER`) that a family of ours is compared with in one of its tables.

    Table 5 has the validation part of FlyingThings3D only. None where the paper has no counterpart.
    """
    family = family.removesuffix("-final")
    if family in _FLYING:
        return "FlyingThings3D validation" if table == 5 or split == "val" else "FlyingThings3D test"
    return _COUNTERPARTS.get(family)
