"""The paper's figures from runs and calibrations of this project, beside what the paper states."""
