"""What outlasts the program: the file in which a run is kept, so that it can go on after a crash, a reboot or a loss of power."""
