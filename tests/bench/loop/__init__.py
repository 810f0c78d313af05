"""The laboratory of `./eulerfsi bench loop`: shapes, experiments, laws and tables."""
