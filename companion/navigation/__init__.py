"""The navigator: the field step (parts A, B, C), its searches and who runs them."""
