"""Estimation over stages: models with noise, smoothing of a whole run, and least squares over a moving horizon."""
