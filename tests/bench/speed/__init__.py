"""The parts of `./eulerfsi bench speed`: runs, kernels, lines, what is measured, the peer."""
