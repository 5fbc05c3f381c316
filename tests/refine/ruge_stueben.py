"""The readable reference for `refine.solvers.multigrid`: the same idea in twenty lines of pyamg.

A is hard for algebraic multigrid, because its colour term is a squared Laplacian. An M-matrix close to A is easy: so a
hierarchy by Ruge and Stueben is set up for that, and one of its V-cycles preconditions the Krylov iterations on A.
`refine.solvers.amg` does the same in parallel and in less memory, with red-black reduction first and smoothing by A
itself on the image. The tests compare the two; `benchmarks.refine` times them.
"""

from __future__ import annotations

import numpy as np
import pyamg
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator, bicgstab, cg

from refine.energy.system import MRFSystem


def m_matrix(system: MRFSystem) -> sp.csr_array:
    """The symmetric 9-point M-matrix close to A.

    N + sum of beta (phibar_p w_pq + phibar_q w_qp) (S_p - S_q)^2: a graph Laplacian in place of the colour term. Twice
    its weights or half of them change the number of iterations by no more than a third, in either form.
    """
    weights = sp.diags_array(system.color_weight) @ (
        sp.eye_array(system.laplacian.shape[0]) - system.laplacian
    )
    couplings = weights + weights.T
    return sp.csr_array(system.five_point + sp.diags_array(couplings.sum(axis=1)) - couplings)


def solve_ruge_stueben(
    system: MRFSystem, start: NDArray[np.float64], tolerance: float
) -> tuple[NDArray[np.float64], int]:
    """Solve A x = b by CG (the exact form) or BiCGSTAB (the paper's).

    Args:
        system: The refinement.
        start: (H, W) initial guess.
        tolerance: Relative residual |b - A x| / |b|.

    Returns:
        x, (H, W), and 0 if the tolerance was reached.
    """
    hierarchy = pyamg.ruge_stuben_solver(
        m_matrix(system),
        max_coarse=200,
        CF=("RS", {"second_pass": True}),
        strength=("classical", {"theta": 0.5}),
        presmoother=("gauss_seidel", {"sweep": "forward"}),
        postsmoother=("gauss_seidel", {"sweep": "backward"}),
    )
    x, info = (cg if system.form == "exact" else bicgstab)(
        LinearOperator((start.size, start.size), matvec=system.apply, dtype=np.float64),
        system.right_hand_side,
        x0=start.ravel(),
        rtol=tolerance,
        M=hierarchy.aspreconditioner(),
        maxiter=1000,
    )
    return x.reshape(system.shape), info
