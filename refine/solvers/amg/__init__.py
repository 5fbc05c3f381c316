"""Algebraic multigrid for the M-matrix that stands for A below the image: Ruge and Stueben's, in numba.

Every level is a symmetric M-matrix M, stored as couplings w_ij = -M_ij > 0 and row sums M 1: so a row sum that is small
beside its couplings is not lost to rounding.
"""
