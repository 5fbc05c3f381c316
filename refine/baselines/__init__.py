"""The methods that are compared, ours and the baselines: one module each, found by `refine.methods.base`."""
