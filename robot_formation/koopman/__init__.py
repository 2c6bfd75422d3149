"""Online DMD and the predictors built on it."""
