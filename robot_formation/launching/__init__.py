"""The table of a run's processes, and the launcher that starts, watches and ends them."""
