"""Logs of real vehicles as recorded: channels, each with its own clock, read from common formats."""
