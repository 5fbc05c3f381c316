"""From a recipe to scenes on disk: frames, passes, staging, quarantine, resumption."""
