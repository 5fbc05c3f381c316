"""How things move: trajectories of rigid bodies, and deformations."""
