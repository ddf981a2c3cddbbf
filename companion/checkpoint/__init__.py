"""What outlasts the program, so that a run can go on after a crash."""
