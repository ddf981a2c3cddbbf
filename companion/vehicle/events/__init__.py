"""What comes in over the link, as plain values: each kind with the time at which it came, by the companion's clock."""
