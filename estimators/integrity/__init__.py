"""Integrity of estimates: a monitor beside an estimator tests its estimates against its readings."""
