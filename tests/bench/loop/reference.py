"""Exact answers that the laws are compared with, and where they come from."""

from __future__ import annotations

# Added mass coefficient C_m of a sphere of radius R in the middle of a cube of half-width 3 R with slip walls, moving
# along an axis. Multipole expansion, Neumann condition exact on the sphere and in least squares on the walls, converged
# to 7 digits; C_m = 1/2 + 0.908 (R/L)^3 to leading order. Unbounded fluid: 1/2 (Lamb, Hydrodynamics, art. 92).
ADDED_MASS_CUBE_3R = 0.5344086
ADDED_MASS_UNBOUNDED = 0.5

# x = omega R / sqrt(G / rho_s) of the spheroidal mode l = 2 of an incompressible elastic sphere: roots of Lamb's
# determinant (Lamb 1882), with the added mass rho_f R / (l + 1) of an unbounded inviscid fluid in its normal stress.
MODE_2_VACUUM = 2.665622
MODE_2_EQUAL_DENSITY = 2.096608


def release_acceleration(ratio: float, added_mass: float) -> float:
    """Downward acceleration over g of a sphere released from rest in inviscid fluid; ratio: density solid : fluid."""
    return (ratio - 1) / (ratio + added_mass)
