"""What people are told, and the parameters that they may set."""
