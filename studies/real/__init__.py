"""Estimators on logs that others have recorded and published."""
