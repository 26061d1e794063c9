"""Time and memory against size, for everything that can grow."""
