"""The parts of `./eulerfsi bench accuracy`: table, sweeps, cases, fits, fronts, plots; README.md tells the columns."""
