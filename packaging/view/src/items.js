// Solids, colliders, passengers: meshes whose points move, tubes along curves, balls at points.
import * as THREE from "three";
import { integers, pointFrames } from "./data.js";

const SIDES = 6;

/** Reads an item's arrays and makes its mesh. smoke: uniforms that darken what lies in the smoke's shadow. */
export async function makeItem(item, frameCount, smoke) {
  const frames = await pointFrames(item, frameCount);
  const material = new THREE.MeshPhysicalMaterial({
    color: new THREE.Color().setRGB(...item.color),
    roughness: item.roughness,
    clearcoat: item.kind === "solid" ? 0.25 : 0.0,
    clearcoatRoughness: 0.35,
    side: THREE.DoubleSide,
  });
  material.onBeforeCompile = (shader) => shadeBySmoke(shader, smoke);
  let shape;
  if (item.form === "curves") shape = makeTubes(item, material);
  else if (item.form === "dots") shape = makeDots(item, material);
  else shape = await makeMesh(item, material);
  shape.object.castShadow = shape.object.receiveShadow = true;
  shape.object.frustumCulled = false;
  const scale = item.size.map((length) => length / 65535);
  const points = new Float32Array(3 * item.point_count);
  let shown = -1;
  return {
    item,
    object: shape.object,
    points,
    on: true,
    show(frame) {
      this.object.visible = this.on && (!item.visible || item.visible[frame]);
      const wanted = Math.min(frame, frames.length - 1);
      if (wanted === shown || !this.object.visible) return;
      shown = wanted;
      const from = frames[wanted];
      for (let i = 0; i < points.length; ++i) points[i] = item.low[i % 3] + from[i] * scale[i % 3];
      shape.move(points);
    },
  };
}

function shadeBySmoke(shader, smoke) {
  Object.assign(shader.uniforms, smoke);
  shader.vertexShader = shader.vertexShader
    .replace("#include <common>", "#include <common>\nvarying vec3 vPlace;")
    .replace("#include <project_vertex>", "#include <project_vertex>\nvPlace = (modelMatrix * vec4(transformed, 1.0)).xyz;");
  shader.fragmentShader = shader.fragmentShader
    .replace(
      "#include <common>",
      `#include <common>
      varying vec3 vPlace;
      uniform highp sampler3D volume;
      uniform mat4 toVolume;
      uniform float inSmoke, ground;
      float through() {
        vec3 p = (toVolume * vec4(vPlace, 1.0)).xyz;
        vec3 inside = step(vec3(0.0), p) * step(p, vec3(1.0));
        return mix(1.0, 0.4 + 0.6 * texture(volume, p).g, inSmoke * inside.x * inside.y * inside.z);
      }`,
    )
    .replace(
      "#include <lights_fragment_end>",
      `#include <lights_fragment_end>
      reflectedLight.directDiffuse *= through();
      float near = smoothstep(0.0, 0.16, vPlace.y - ground);
      reflectedLight.indirectDiffuse *= mix(1.0, 0.55 + 0.45 * near, clamp(0.5 - 0.5 * normal.y, 0.0, 1.0));`,
    );
}

async function makeMesh(item, material) {
  const triangles = await integers(item.triangles, 4);
  const source = item.corners === null ? null : await integers(item.corners, 4);
  const count = source ? source.length : item.point_count;
  const geometry = new THREE.BufferGeometry();
  const position = new THREE.BufferAttribute(new Float32Array(3 * count), 3);
  const normal = new THREE.BufferAttribute(new Float32Array(3 * count), 3);
  geometry.setAttribute("position", position);
  geometry.setAttribute("normal", normal);
  geometry.setIndex(new THREE.BufferAttribute(triangles, 1));
  return {
    object: new THREE.Mesh(geometry, material),
    move(points) {
      if (source) {
        for (let i = 0; i < count; ++i) {
          for (let k = 0; k < 3; ++k) position.array[3 * i + k] = points[3 * source[i] + k];
        }
      } else position.array.set(points);
      setNormals(position.array, triangles, normal.array);
      position.needsUpdate = normal.needsUpdate = true;
    },
  };
}

/** Sum of the faces' normals, weighted by their areas; the shader makes them unit vectors. */
function setNormals(p, triangles, normals) {
  normals.fill(0);
  for (let t = 0; t < triangles.length; t += 3) {
    const a = 3 * triangles[t], b = 3 * triangles[t + 1], c = 3 * triangles[t + 2];
    const ux = p[b] - p[a], uy = p[b + 1] - p[a + 1], uz = p[b + 2] - p[a + 2];
    const vx = p[c] - p[a], vy = p[c + 1] - p[a + 1], vz = p[c + 2] - p[a + 2];
    const x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
    for (const i of [a, b, c]) {
      normals[i] += x;
      normals[i + 1] += y;
      normals[i + 2] += z;
    }
  }
  for (let i = 0; i < normals.length; i += 3) {
    const length = Math.hypot(normals[i], normals[i + 1], normals[i + 2]) || 1;
    normals[i] /= length;
    normals[i + 1] /= length;
    normals[i + 2] /= length;
  }
}

function makeTubes(item, material) {
  const count = SIDES * item.point_count;
  const geometry = new THREE.BufferGeometry();
  const position = new THREE.BufferAttribute(new Float32Array(3 * count), 3);
  const normal = new THREE.BufferAttribute(new Float32Array(3 * count), 3);
  geometry.setAttribute("position", position);
  geometry.setAttribute("normal", normal);
  const index = [];
  let first = 0;
  for (const length of item.counts) {
    for (let i = first; i < first + length - 1; ++i) {
      for (let k = 0; k < SIDES; ++k) {
        const a = SIDES * i + k, b = SIDES * i + ((k + 1) % SIDES);
        index.push(a, b, a + SIDES, b, b + SIDES, a + SIDES);
      }
    }
    first += length;
  }
  geometry.setIndex(index);
  const object = new THREE.Mesh(geometry, material);
  const tangent = new THREE.Vector3(), side = new THREE.Vector3(), up = new THREE.Vector3(), out = new THREE.Vector3();
  const move = (points) => {
    let start = 0;
    const at = (i) => new THREE.Vector3().fromArray(points, 3 * i);
    for (const length of item.counts) {
      side.set(1, 0.01, 0.02);
      for (let i = start; i < start + length; ++i) {
        tangent.subVectors(at(Math.min(i + 1, start + length - 1)), at(Math.max(i - 1, start))).normalize();
        side.addScaledVector(tangent, -side.dot(tangent));
        if (side.lengthSq() < 1e-6) side.set(tangent.y, tangent.z, tangent.x).addScaledVector(tangent, -tangent.x);
        up.crossVectors(tangent, side.normalize());
        for (let k = 0; k < SIDES; ++k) {
          const angle = (2 * Math.PI * k) / SIDES;
          out.copy(side).multiplyScalar(Math.cos(angle)).addScaledVector(up, Math.sin(angle));
          out.toArray(normal.array, 3 * (SIDES * i + k));
          out.multiplyScalar(item.radius).add(at(i)).toArray(position.array, 3 * (SIDES * i + k));
        }
      }
      start += length;
    }
    position.needsUpdate = normal.needsUpdate = true;
  };
  return { object, move };
}

function makeDots(item, material) {
  const object = new THREE.InstancedMesh(new THREE.IcosahedronGeometry(item.radius, 1), material, item.point_count);
  const matrix = new THREE.Matrix4();
  const move = (points) => {
    for (let i = 0; i < item.point_count; ++i) {
      object.setMatrixAt(i, matrix.makeTranslation(points[3 * i], points[3 * i + 1], points[3 * i + 2]));
    }
    object.instanceMatrix.needsUpdate = true;
  };
  return { object, move };
}
