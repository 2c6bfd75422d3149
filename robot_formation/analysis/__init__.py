"""From a run's bag to its figures, tables and pictures."""
