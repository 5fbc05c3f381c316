"""Training of the networks on stereo data sets, and prediction with what was trained."""
