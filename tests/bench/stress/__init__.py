"""The parts of `./eulerfsi bench stress`: its cases and how one run is judged."""
