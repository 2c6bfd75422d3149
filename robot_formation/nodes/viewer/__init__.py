"""A run that goes on, in three dimensions in a browser."""
