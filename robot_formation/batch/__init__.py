"""Many independent runs: a pool of processes."""
