"""Disparity refinement: a continuous MRF over disparity, confidence, gradients and image; metrics,
evaluation, report.

The MRF and the metrics take numpy arrays and know nothing of data sets or networks.
"""

from refine.energy.parameters import MRFParameters
from refine.mrf.solve import ConvergenceWarning, MRFSolution, SolveInfo, refine_disparity, solve_mrf
from refine.solvers import SolverError

__all__ = [
    "ConvergenceWarning",
    "MRFParameters",
    "MRFSolution",
    "SolveInfo",
    "SolverError",
    "refine_disparity",
    "solve_mrf",
]
