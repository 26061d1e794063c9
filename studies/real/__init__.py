"""Estimators on published logs."""
