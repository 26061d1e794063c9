"""Tolerance within which two times are the same."""

from __future__ import annotations

TIME_TOLERANCE = 1e-9
"""tolerance [s]: two times closer than this are the same"""
