"""Files, temporary folders and signals: what is asked of the operating system."""
