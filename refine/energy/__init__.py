"""The MRF's energy: its parameters, its affinities, its linear system. Source: section 3 of the paper."""
