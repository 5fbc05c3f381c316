"""The pipelines that join rendering, training and refinement."""
