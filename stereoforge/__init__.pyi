from .pipelines.refiner import RefinedPair, StereoRefiner

__all__ = ["RefinedPair", "StereoRefiner"]
