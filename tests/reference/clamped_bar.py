"""Sag of a bar that is clamped at one end, by linear elasticity in three dimensions: the constants of
tests/unit/given/test_given_motion.cpp. Taylor-Hood hexahedra (displacement quadratic, pressure linear).

Run by hand: needs scikit-fem (12.0), which the project does not. Prints, for n elements over the height, the sag of the
free end's corners over that of Timoshenko's beam with Cowper's shear coefficient (1966).
n = 2, 4, 6: 0.9317, 0.9370, 0.9384 for Poisson's ratio 1/2; 0.9764, 0.9791, 0.9797 for 0.3.
"""

import numpy as np
import skfem as fem
from scipy.sparse import bmat
from skfem.helpers import ddot, div, sym_grad

HIGH, LONG = 0.1, 0.4  # m
WEIGHT = 9800.0  # N/m^3


def sag(shear: float, bulk_compliance: float, n: int) -> float:
    """Of a bar with this shear modulus [Pa] and 1 / lambda [1/Pa], with n elements over its height [m]."""
    t = np.linspace(0.0, 1.0, 4 * n + 1)
    mesh = fem.MeshHex.init_tensor(
        LONG * 0.5 * (t + t * t), np.linspace(0.0, HIGH, n + 1), np.linspace(0.0, 0.5 * HIGH, n // 2 + 1)
    )
    displacement = fem.Basis(mesh, fem.ElementVector(fem.ElementHex2()), intorder=4)
    pressure = displacement.with_element(fem.ElementHex1())
    stiffness = fem.BilinearForm(lambda u, v, w: 2.0 * shear * ddot(sym_grad(u), sym_grad(v))).assemble(displacement)
    divergence = fem.BilinearForm(lambda u, q, w: div(u) * q).assemble(displacement, pressure)
    compliance = fem.BilinearForm(lambda p, q, w: bulk_compliance * p * q).assemble(pressure)
    load = fem.LinearForm(lambda v, w: -WEIGHT * v[1]).assemble(displacement)
    system = bmat([[stiffness, -divergence.T], [-divergence, -compliance]], "csr")
    right = np.concatenate([load, np.zeros(pressure.N)])
    clamped = displacement.get_dofs(lambda x: np.isclose(x[0], 0.0)).all()
    mirror = displacement.get_dofs(lambda x: np.isclose(x[2], 0.5 * HIGH)).all(["u^3"])
    u = fem.solve(*fem.condense(system, right, D=np.unique(np.concatenate([clamped, mirror]))))
    x, y, z = mesh.p
    corners = np.isclose(x, LONG) & (np.isclose(y, 0.0) | np.isclose(y, HIGH)) & np.isclose(z, 0.0)
    return -float(np.mean(u[displacement.nodal_dofs[1, corners]]))


def beam(shear: float, poisson: float) -> float:
    """Timoshenko's [m]."""
    young, section = 2.0 * shear * (1.0 + poisson), 10.0 * (1.0 + poisson) / (12.0 + 11.0 * poisson)
    return 1.5 * WEIGHT * LONG**4 / (young * HIGH**2) + WEIGHT * LONG**2 / (2.0 * section * shear)


if __name__ == "__main__":
    SHEAR = 1e6 / 2.6
    for n in (2, 4, 6):
        for poisson in (0.5, 0.3):
            bulk_compliance = (1.0 - 2.0 * poisson) / (2.0 * SHEAR * poisson)
            print(n, poisson, sag(SHEAR, bulk_compliance, n) / beam(SHEAR, poisson), flush=True)
