"""Ours and the regressor: one module a row of the tables. The rivals are in `refine.baselines`."""
