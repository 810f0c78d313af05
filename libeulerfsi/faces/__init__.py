"""What is generated from the parameter table and the C headers; generate.py writes it."""
