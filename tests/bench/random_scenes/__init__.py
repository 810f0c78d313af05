"""Random scenes: what is drawn (ranges.toml), the scenes, the laws that every record must keep."""
