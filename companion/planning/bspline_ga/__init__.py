"""The B-spline genetic algorithm of Kwasniewski & Gosiewski 2018, section 3."""
