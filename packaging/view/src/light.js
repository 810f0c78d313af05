// Light that reaches each cell of the smoke: a sweep through the grid, layer by layer, away from the lamp.

/**
 * out[2 i] density, out[2 i + 1] what the smoke and the solids before cell i let through, both 0 to 255.
 * roots: square roots of densities; blocked: cells with a surface; toLight: direction in cells; depth: optical depth of
 * one cell's length along each axis at density 1 (of 255).
 */
export function sweep(roots, blocked, cells, toLight, length, depth, out) {
  const size = toLight.map(Math.abs);
  const axis = size.indexOf(Math.max(...size));
  const [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
  const stride = [1, cells[0], cells[0] * cells[1]];
  const [nu, nv, n] = [cells[u], cells[v], cells[axis]];
  const du = toLight[u] / size[axis], dv = toLight[v] / size[axis];
  const step = length / size[axis]; // world length between two layers along the ray
  const lit = new Float32Array(nu * nv).fill(1);
  let before = new Float32Array(nu * nv).fill(1);
  for (let layer = 0; layer < n; ++layer) {
    const w = toLight[axis] > 0 ? n - 1 - layer : layer;
    for (let b = 0; b < nv; ++b) {
      const y = b + (layer ? dv : 0), y0 = Math.floor(y), fy = y - y0;
      for (let a = 0; a < nu; ++a) {
        const x = a + (layer ? du : 0), x0 = Math.floor(x), fx = x - x0;
        const c = at(before, nu, nv, x0, y0), d = at(before, nu, nv, x0 + 1, y0);
        const e = at(before, nu, nv, x0, y0 + 1), f = at(before, nu, nv, x0 + 1, y0 + 1);
        const light = (c + (d - c) * fx) * (1 - fy) + (e + (f - e) * fx) * fy;
        const i = a * stride[u] + b * stride[v] + w * stride[axis];
        const density = (roots[i] / 255) ** 2;
        out[2 * i] = roots[i];
        out[2 * i + 1] = 255 * light;
        lit[b * nu + a] = light * Math.exp(-depth * density * step) * (blocked[i] ? 0.35 : 1);
      }
    }
    before.set(lit);
  }
}

function at(values, nu, nv, x, y) {
  return x < 0 || y < 0 || x >= nu || y >= nv ? 1 : values[y * nu + x];
}
