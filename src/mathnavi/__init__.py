"""mathnavi: planners and observers close the loop with MuJoCo's physics."""
