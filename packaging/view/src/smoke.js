// The smoke: a texture of density and light, marched through along the line of sight, up to the solids' depth.
import * as THREE from "three";
import { density } from "./data.js";
import { sweep } from "./light.js";

const MARCH = `
precision highp float;
precision highp sampler3D;
uniform sampler3D volume;
uniform sampler2D depthMap;
uniform mat4 toVolume, fromClip;
uniform vec3 eye, toLight, lightColor, skyColor;
uniform float thick;
uniform int steps;
varying vec2 place;

float noise(vec2 p) { return fract(52.9829189 * fract(dot(p, vec2(0.06711056, 0.00583715)))); }

void main() {
  vec4 far = fromClip * vec4(place * 2.0 - 1.0, 1.0, 1.0);
  vec3 ray = normalize(far.xyz / far.w - eye);
  vec4 hit = fromClip * vec4(vec3(place, texture2D(depthMap, place).x) * 2.0 - 1.0, 1.0);
  float end = length(hit.xyz / hit.w - eye);
  vec3 o = (toVolume * vec4(eye, 1.0)).xyz, d = mat3(toVolume) * ray;
  vec3 a = -o / d, b = (1.0 - o) / d;
  vec3 near = min(a, b), exits = max(a, b);
  float t0 = max(max(near.x, near.y), max(near.z, 0.0)), t1 = min(min(exits.x, exits.y), min(exits.z, end));
  if (t1 <= t0) discard;
  float dt = (t1 - t0) / float(steps), t = t0 + dt * noise(gl_FragCoord.xy);
  float cosine = dot(ray, toLight), g = 0.35;
  float phase = mix(1.0, (1.0 - g * g) / pow(1.0 + g * g - 2.0 * g * cosine, 1.5), 0.5);
  vec3 color = vec3(0.0);
  float clear = 1.0;
  for (int i = 0; i < steps; ++i, t += dt) {
    vec2 s = texture(volume, o + t * d).rg;
    float rho = s.r * s.r;
    if (rho > 0.0002) {
      float alpha = 1.0 - exp(-thick * rho * dt);
      float light = 0.85 * s.g + 0.15 * sqrt(s.g);
      color += clear * alpha * (lightColor * light * phase + skyColor * (0.45 + 0.55 * s.g));
      clear *= 1.0 - alpha;
      if (clear < 0.01) break;
    }
  }
  gl_FragColor = vec4(color, 1.0 - clear);
}`;
const COMPOSE = `
uniform sampler2D smokeMap;
varying vec2 place;
void main() {
  vec4 s = texture2D(smokeMap, place);
  if (s.a < 0.003) discard;
  gl_FragColor = vec4(s.rgb / s.a, s.a);
  #include <tonemapping_fragment>
  #include <colorspace_fragment>
  gl_FragColor.rgb *= s.a;
}`;
const QUAD = `varying vec2 place; void main() { place = uv; gl_Position = vec4(position.xy, 0.0, 1.0); }`;

export class Smoke {
  constructor(facts, toLight) {
    this.facts = facts;
    this.cells = facts.cells;
    this.strength = 1;
    this.kept = new Map();
    const [nx, ny, nz] = this.cells;
    this.data = new Uint8Array(2 * nx * ny * nz);
    this.texture = new THREE.Data3DTexture(this.data, nx, ny, nz);
    Object.assign(this.texture, { format: THREE.RGFormat, type: THREE.UnsignedByteType, unpackAlignment: 1 });
    this.texture.minFilter = this.texture.magFilter = THREE.LinearFilter;
    this.toWorld = new THREE.Matrix4().fromArray(facts.matrix);
    this.toVolume = this.toWorld.clone().invert();
    this.toLight = toLight;
    this.target = new THREE.WebGLRenderTarget(1, 1, { type: THREE.HalfFloatType, depthBuffer: false });
    this.depth = new THREE.WebGLRenderTarget(1, 1, { depthTexture: new THREE.DepthTexture(1, 1) });
    this.hidden = new THREE.MeshBasicMaterial({ colorWrite: false, side: THREE.DoubleSide });
    const uniform = (value) => ({ value });
    this.march = new THREE.ShaderMaterial({
      vertexShader: QUAD,
      fragmentShader: MARCH,
      depthTest: false,
      depthWrite: false,
      uniforms: {
        volume: uniform(this.texture),
        depthMap: uniform(this.depth.depthTexture),
        toVolume: uniform(this.toVolume),
        fromClip: uniform(new THREE.Matrix4()),
        eye: uniform(new THREE.Vector3()),
        toLight: uniform(toLight),
        lightColor: uniform(new THREE.Color(1.0, 0.95, 0.88).multiplyScalar(0.72)),
        skyColor: uniform(new THREE.Color(0.17, 0.21, 0.28)),
        thick: uniform(1),
        steps: uniform(96),
      },
    });
    this.compose = new THREE.ShaderMaterial({
      vertexShader: QUAD,
      fragmentShader: COMPOSE,
      uniforms: { smokeMap: uniform(this.target.texture) },
      transparent: true,
      depthTest: false,
      depthWrite: false,
      premultipliedAlpha: true,
      blending: THREE.CustomBlending,
      blendSrc: THREE.OneFactor,
      blendDst: THREE.OneMinusSrcAlphaFactor,
    });
    this.quad = new THREE.Mesh(new THREE.PlaneGeometry(2, 2), this.march);
    this.quad.frustumCulled = false;
    this.flat = new THREE.Scene().add(this.quad);
    this.plain = new THREE.Camera();
    this.shown = null;
  }

  /** Reads a frame's densities; those read before are kept. */
  async load(frame) {
    const entry = this.facts.frames[frame];
    if (entry && !this.kept.has(frame)) this.kept.set(frame, await density(entry, this.cells));
  }

  has(frame) {
    return !this.facts.frames[frame] || this.kept.has(frame);
  }

  /** Lights a frame and takes it to the graphics card. items: what throws shadows. */
  show(frame, items) {
    const entry = this.facts.frames[frame];
    this.empty = !entry || !this.kept.has(frame);
    if (this.empty) return;
    this.shown = { frame, items };
    const [nx, ny, nz] = this.cells;
    const thick = this.facts.thickness * entry.scale * this.strength;
    const blocked = this.blocked(items);
    const linear = new THREE.Matrix3().setFromMatrix4(this.toVolume);
    const direction = this.toLight.clone().applyMatrix3(linear);
    const inCells = [direction.x * nx, direction.y * ny, direction.z * nz];
    sweep(this.kept.get(frame), blocked, this.cells, inCells, 1, thick * 1.3, this.data);
    if (this.facts.flat) for (let i = 1; i < this.data.length; i += 2) this.data[i] = 255;
    this.texture.needsUpdate = true;
    this.march.uniforms.thick.value = thick;
  }

  again() {
    if (this.shown) this.show(this.shown.frame, this.shown.items);
  }

  /** Cells that a surface passes through. */
  blocked(items) {
    const [nx, ny, nz] = this.cells;
    const result = new Uint8Array(nx * ny * nz);
    const m = this.toVolume.elements;
    for (const { object, points } of items) {
      if (!object.visible) continue;
      for (let i = 0; i < points.length; i += 3) {
        const [x, y, z] = [points[i], points[i + 1], points[i + 2]];
        const a = Math.floor((m[0] * x + m[4] * y + m[8] * z + m[12]) * nx);
        const b = Math.floor((m[1] * x + m[5] * y + m[9] * z + m[13]) * ny);
        const c = Math.floor((m[2] * x + m[6] * y + m[10] * z + m[14]) * nz);
        if (a >= 0 && b >= 0 && c >= 0 && a < nx && b < ny && c < nz) result[(c * ny + b) * nx + a] = 1;
      }
    }
    return result;
  }

  /** Draws over what the canvas shows. share: of the canvas's resolution. */
  draw(renderer, scene, camera, share) {
    if (this.empty) return;
    const size = renderer.getDrawingBufferSize(new THREE.Vector2()).multiplyScalar(share).ceil();
    if (size.x !== this.target.width || size.y !== this.target.height) {
      this.target.setSize(size.x, size.y);
      this.depth.setSize(size.x, size.y);
    }
    const shadows = renderer.shadowMap.autoUpdate;
    renderer.shadowMap.autoUpdate = false;
    scene.overrideMaterial = this.hidden;
    renderer.setRenderTarget(this.depth);
    renderer.clear();
    renderer.render(scene, camera);
    scene.overrideMaterial = null;
    const uniforms = this.march.uniforms;
    uniforms.eye.value.setFromMatrixPosition(camera.matrixWorld);
    uniforms.fromClip.value.multiplyMatrices(camera.matrixWorld, camera.projectionMatrixInverse);
    this.quad.material = this.march;
    renderer.setRenderTarget(this.target);
    renderer.setClearColor(0x000000, 0);
    renderer.clear();
    renderer.render(this.flat, this.plain);
    renderer.setRenderTarget(null);
    this.quad.material = this.compose;
    const clears = renderer.autoClear;
    renderer.autoClear = false;
    renderer.render(this.flat, this.plain);
    renderer.autoClear = clears;
    renderer.shadowMap.autoUpdate = shadows;
  }
}
