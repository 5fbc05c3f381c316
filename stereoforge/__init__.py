"""The command line, and the pipelines that join scenes, datagen, training and refine."""
