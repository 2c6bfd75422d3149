"""A detector node and a predictor for robot_formation, in a package of their own."""
