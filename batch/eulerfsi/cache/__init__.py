"""The cache: what a run writes, and what is taken over from another."""
