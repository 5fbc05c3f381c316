"""From the frames of data sets to batches: crops, augmentation, pseudo labels."""
