"""Graph searches over the fields: Dijkstra, A*, Theta*, D* Lite."""
