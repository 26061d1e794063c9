"""Logs of real vehicles as they were recorded: channels, each with its own clock, read from the formats of others."""
