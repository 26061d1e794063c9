"""Integrity of estimates: what an estimator says is tested against its readings, by a monitor beside it."""
