"""The energy of the continuous MRF and the linear systems whose solution refines a disparity map.

    E(S) =  sum_p tau_p (S_p - D_p)^2
          + alpha sum_p [phi_x,p (S_right - S_p - Gx_p)^2 + phi_y,p (S_below - S_p - Gy_p)^2]
          + beta  sum_p phibar_p (S_p - sum_q w_pq S_q)^2,       phibar = 2 - phi_x - phi_y

D is the initial disparity, tau its confidence, G the predicted gradient, phi and w the image's weights
(`refine.energy.affinity`). A gradient term exists where the neighbour is inside the image and G is not
NaN.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from refine.energy.affinity import Floats, edge_weights, neighbor_slices, neighbor_weights
from refine.energy.parameters import MRFParameters

Form = Literal["exact", "paper"]


@dataclass(frozen=True)
class MRFSystem:
    """A x = b for one image, x the refined disparity in reading order.

    `form` "exact" is the minimiser of E, with N = T + alpha (Cx' Phi_x Cx + Cy' Phi_y Cy) and L = Id - W:

        (N + beta L' Phibar L) x = T D + alpha (Cx' Phi_x Gx + Cy' Phi_y Gy)

    `form` "paper" is Eq. 8 as printed, N + beta Phibar L on the left: not symmetric, not the minimiser.
    """

    form: Form
    shape: tuple[int, int]
    five_point: sp.csr_array
    """N: data and gradient terms."""
    laplacian: sp.csr_array
    """L = Id - W."""
    color_weight: Floats
    """beta * phibar, one number a pixel."""
    right_hand_side: Floats

    def apply(self, x: Floats) -> Floats:
        """A x, without ever building the 25-point matrix of the exact form."""
        color: Floats = self.color_weight * (self.laplacian @ x)
        if self.form == "exact":
            color = self._laplacian_transposed @ color
        product: Floats = self.five_point @ x + color
        return product

    def diagonal(self) -> Floats:
        """The diagonal of A."""
        color: Floats = self.color_weight
        if self.form == "exact":
            color = self.laplacian.power(2).T @ self.color_weight
        else:
            color = color * self.laplacian.diagonal()
        diagonal: Floats = self.five_point.diagonal() + color
        return diagonal

    def matrix(self) -> sp.csr_array:
        """A itself: 25 entries a row in the exact form, 9 in the paper's."""
        color = sp.diags_array(self.color_weight) @ self.laplacian
        if self.form == "exact":
            color = self._laplacian_transposed @ color
        return sp.csr_array(self.five_point + color)

    def relative_residual(self, x: Floats) -> float:
        """|b - A x| / |b|, or |A x| where b is 0."""
        size = float(np.linalg.norm(self.right_hand_side))
        return float(np.linalg.norm(self.right_hand_side - self.apply(x))) / (size or 1.0)

    @cached_property
    def _laplacian_transposed(self) -> sp.csr_array:
        return sp.csr_array(self.laplacian.T)


def build_system(
    disparity: Floats,
    confidence: Floats,
    gradient: Floats,
    image: NDArray[np.uint8],
    parameters: MRFParameters,
    form: Form,
    gradient_factor: Floats | None = None,
) -> MRFSystem:
    """Build the linear system of a refinement problem (shapes as for `refine.refine_disparity`, not checked here).

    `gradient_factor`, (H, W, 2), multiplies the weights of the gradient terms.
    """
    phi_x, phi_y = edge_weights(image, parameters.sigma_r)
    data_weight = np.maximum(confidence, parameters.confidence_floor).ravel()
    matrix = sp.diags_array(data_weight)
    right_hand_side = data_weight * disparity.ravel()
    factor = np.ones_like(gradient) if gradient_factor is None else gradient_factor
    for channel, (axis, phi) in enumerate(((1, phi_x), (0, phi_y))):
        wanted = gradient[..., channel]
        weight = parameters.alpha * np.where(np.isfinite(wanted), phi * factor[..., channel], 0.0).ravel()
        difference = forward_difference(disparity.shape, axis)
        weighted = sp.csr_array(difference.T @ sp.diags_array(weight))
        matrix = matrix + weighted @ difference
        right_hand_side = right_hand_side + weighted @ np.nan_to_num(wanted, nan=0.0).ravel()
    return MRFSystem(
        form=form,
        shape=(disparity.shape[0], disparity.shape[1]),
        five_point=sp.csr_array(matrix),
        laplacian=_laplacian(neighbor_weights(image)),
        color_weight=parameters.beta * (2 - phi_x - phi_y).ravel(),
        right_hand_side=right_hand_side,
    )


def forward_difference(shape: tuple[int, ...], axis: int) -> sp.csr_array:
    """The matrix of x[next] - x[here] along an axis of an image in reading order; rows without a next are
    0."""
    index = np.arange(shape[0] * shape[1], dtype=np.int32).reshape(shape)
    here = np.delete(index, -1, axis=axis).ravel()
    following = np.delete(index, 0, axis=axis).ravel()
    ones = np.ones(here.size)
    entries = np.concatenate([-ones, ones])
    places = (np.concatenate([here, here]), np.concatenate([here, following]))
    return sp.csr_array(sp.coo_array((entries, places), shape=(index.size, index.size)))


def _laplacian(weights: Floats) -> sp.csr_array:
    """Id - W for the (8, H, W) weights of `neighbor_weights`."""
    shape = weights.shape[1:]
    index = np.arange(shape[0] * shape[1], dtype=np.int32).reshape(shape)
    rows, columns, entries = [index.ravel()], [index.ravel()], [np.ones(index.size)]
    for plane, (here, there) in zip(weights, neighbor_slices(shape), strict=True):
        rows.append(index[here].ravel())
        columns.append(index[there].ravel())
        entries.append(-plane[here].ravel())
    places = (np.concatenate(rows), np.concatenate(columns))
    return sp.csr_array(sp.coo_array((np.concatenate(entries), places), shape=(index.size, index.size)))
