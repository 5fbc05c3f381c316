"""From frames to batches: crops, augmentation, pseudo labels."""
