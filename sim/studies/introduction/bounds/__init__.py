"""Estimators of all kinds against the posterior Cramér-Rao bound."""
