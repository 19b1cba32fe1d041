"""Studies of error bars, faults and verdicts."""
