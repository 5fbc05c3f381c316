"""The report: the paper's tables and figures beside ours, as one HTML page and as files."""
