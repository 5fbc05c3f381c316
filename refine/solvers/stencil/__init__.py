"""The MRF's linear system as stencils on the image grid: weights, operator, right-hand side."""
