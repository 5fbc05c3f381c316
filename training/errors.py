"""What a user can get wrong when training or predicting."""


class TrainingError(Exception):
    """One sentence naming what is wrong and where; the command line prints it without a traceback."""
