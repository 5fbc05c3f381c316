"""Solving the MRF: the paper's quadratic energy, the robust one, the posterior, and a form to train through."""
