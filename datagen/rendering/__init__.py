"""From a recipe to scenes on disk: frames and passes, staging, quarantine, resuming."""
