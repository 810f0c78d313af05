"""The run: from a scene to a cache, and how long it will take."""
