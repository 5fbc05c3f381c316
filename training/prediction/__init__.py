"""Trained networks at work: on a pair, on a disparity from elsewhere, as ONNX."""
