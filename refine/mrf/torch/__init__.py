"""The MRF in torch: batched and differentiable."""
