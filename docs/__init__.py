"""Documentation pages, and what writes their tables."""
