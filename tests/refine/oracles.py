"""The MRF written out pixel by pixel, for the tests to compare with; shares no code with `refine`."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.optimize import minimize

from refine import MRFParameters
from tests.refine.worlds import Problem

AROUND = [(dy, dx) for dy in (-1, 0, 1) for dx in (-1, 0, 1) if dy or dx]


def levin_weights(image: np.ndarray, y: int, x: int) -> dict[tuple[int, int], float]:
    """w_pq of METHOD's definition for one pixel, by plain arithmetic."""
    height, width = image.shape[:2]
    grey = [[sum(float(c) for c in image[r, c_]) / 3 / 255 for c_ in range(width)] for r in range(height)]
    around = [(dy, dx) for dy, dx in AROUND if 0 <= y + dy < height and 0 <= x + dx < width]
    if not around:
        return {}
    values = [grey[y + dy][x + dx] for dy, dx in around]
    window = [*values, grey[y][x]]
    mean = sum(window) / len(window)
    variance = sum((g - mean) ** 2 for g in window) / len(window)
    nearest = min((g - grey[y][x]) ** 2 for g in values)
    scale = max(0.6 * variance, -nearest / math.log(0.01), 2e-6)
    raw = [math.exp(-((g - grey[y][x]) ** 2) / scale) for g in values]
    return {place: weight / sum(raw) for place, weight in zip(around, raw, strict=True)}


def phis(image: np.ndarray, sigma_r: float, y: int, x: int) -> tuple[float, float]:
    here = image[y, x].astype(float)
    right = image[y, min(x + 1, image.shape[1] - 1)].astype(float)
    below = image[min(y + 1, image.shape[0] - 1), x].astype(float)
    weigh = lambda there: float(np.exp(-((there - here) ** 2).sum() / (2 * sigma_r**2)))  # noqa: E731
    return weigh(right), weigh(below)


def energy_terms(problem: Problem, parameters: MRFParameters) -> list[tuple[float, dict[int, float], float]]:
    """E(S) as a list of (weight, {pixel: coefficient}, wanted): the sum of weight (sum coefficient S -
    wanted)^2."""
    height, width = problem.disparity.shape
    number = lambda y, x: y * width + x  # noqa: E731
    terms = []
    for y in range(height):
        for x in range(width):
            trust = max(problem.confidence[y, x], parameters.confidence_floor)
            terms.append((trust, {number(y, x): 1.0}, problem.disparity[y, x]))
            phi_x, phi_y = phis(problem.image, parameters.sigma_r, y, x)
            for phi, (ny, nx), channel in ((phi_x, (y, x + 1), 0), (phi_y, (y + 1, x), 1)):
                if ny < height and nx < width:
                    coefficients = {number(ny, nx): 1.0, number(y, x): -1.0}
                    terms.append((parameters.alpha * phi, coefficients, problem.gradient[y, x, channel]))
            color = {number(y, x): 1.0}
            for (dy, dx), weight in levin_weights(problem.image, y, x).items():
                color[number(y + dy, x + dx)] = -weight
            terms.append((parameters.beta * (2 - phi_x - phi_y), color, 0.0))
    return terms


def dense_minimiser(problem: Problem, parameters: MRFParameters) -> np.ndarray:
    """argmin E by dense least squares."""
    terms = energy_terms(problem, parameters)
    matrix = np.zeros((len(terms), problem.disparity.size))
    wanted = np.zeros(len(terms))
    for row, (weight, coefficients, value) in enumerate(terms):
        for pixel, coefficient in coefficients.items():
            matrix[row, pixel] += np.sqrt(weight) * coefficient
        wanted[row] = np.sqrt(weight) * value
    return np.linalg.lstsq(matrix, wanted, rcond=None)[0].reshape(problem.disparity.shape)


def robust_energy(
    problem: Problem, parameters: MRFParameters, scale: float
) -> Callable[[np.ndarray], tuple[float, np.ndarray]]:
    """E with Charbonnier's penalty for the gradient terms, and its slope, of a disparity map in reading order."""
    terms = energy_terms(problem, parameters)
    matrix = np.zeros((len(terms), problem.disparity.size))
    weights, wanted, robust = (np.zeros(len(terms)) for _ in range(3))
    for row, (weight, coefficients, value) in enumerate(terms):
        for pixel, coefficient in coefficients.items():
            matrix[row, pixel] += coefficient
        weights[row], wanted[row] = weight, value
        # A pixel's terms come in this order: data, gradients, colour; the last of these has nothing to be like.
        robust[row] = len(coefficients) == 2 and value != 0

    def energy(x: np.ndarray) -> tuple[float, np.ndarray]:
        off = matrix @ x - wanted
        root = np.sqrt(1 + (off / scale) ** 2)
        penalty = np.where(robust, 2 * scale**2 * (root - 1), off**2)
        slope = np.where(robust, 2 * off / root, 2 * off)
        return float(weights @ penalty), matrix.T @ (weights * slope)

    return energy


def robust_minimiser(problem: Problem, parameters: MRFParameters, scale: float) -> np.ndarray:
    """argmin of `robust_energy`, by quasi-Newton steps on it."""
    found = minimize(
        robust_energy(problem, parameters, scale),
        problem.disparity.ravel(),
        jac=True,
        method="L-BFGS-B",
        options={"maxiter": 20000, "maxfun": 40000, "ftol": 1e-15, "gtol": 1e-9, "maxcor": 50},
    )
    return found.x.reshape(problem.disparity.shape)


def dense_paper_solution(problem: Problem, parameters: MRFParameters) -> np.ndarray:
    """Eq. 8 as printed, assembled densely pixel by pixel."""
    height, width = problem.disparity.shape
    size = height * width
    a, b = np.zeros((size, size)), np.zeros(size)
    for y in range(height):
        for x in range(width):
            p = y * width + x
            trust = max(problem.confidence[y, x], parameters.confidence_floor)
            a[p, p] += trust
            b[p] += trust * problem.disparity[y, x]
            phi_x, phi_y = phis(problem.image, parameters.sigma_r, y, x)
            for phi, (ny, nx), channel in ((phi_x, (y, x + 1), 0), (phi_y, (y + 1, x), 1)):
                if ny < height and nx < width:
                    q, weight = ny * width + nx, parameters.alpha * phi
                    a[[p, q], [p, q]] += weight
                    a[[p, q], [q, p]] -= weight
                    b[p] -= weight * problem.gradient[y, x, channel]
                    b[q] += weight * problem.gradient[y, x, channel]
            color = parameters.beta * (2 - phi_x - phi_y)
            a[p, p] += color
            for (dy, dx), weight in levin_weights(problem.image, y, x).items():
                a[p, (y + dy) * width + x + dx] -= color * weight
    return np.linalg.solve(a, b).reshape(height, width)
