"""Training of the networks on stereo data sets, and prediction with what was trained."""

from stereoforge_kit.siblings import check_siblings

check_siblings(__file__, "scenes", "datagen", "refine")
