"""The rivals that ours is compared with: one module each, found by `refine.registry`."""
