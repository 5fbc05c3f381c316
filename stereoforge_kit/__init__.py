"""What the packages share: files, processes, pictures and pages, classical matching, errors."""
