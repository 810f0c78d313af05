"""The scene: a USD stage is checked and read."""
