// The picture: items on a floor, one lamp with a soft shadow, sky light, the box, the smoke; a camera that orbits.
import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { makeItem } from "./items.js";
import { Smoke } from "./smoke.js";

const TO_LIGHT = new THREE.Vector3(-0.5, 1.0, 0.55).normalize();
const [MARGIN_TOP, MARGIN_BOTTOM] = [76, 92]; // pixels of the canvas that title and transport cover
const SLOW = 70; // milliseconds a picture may take before the smoke gets coarser

export class Studio {
  /** Throws where there is no WebGL 2. */
  constructor(canvas, facts) {
    this.facts = facts;
    this.canvas = canvas;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true, preserveDrawingBuffer: true });
    this.renderer.setClearColor(0x000000, 0);
    this.renderer.toneMapping = THREE.NeutralToneMapping;
    this.renderer.toneMappingExposure = 0.95;
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = THREE.VSMShadowMap;
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(32, 1, 0.02, 60);
    this.controls = new OrbitControls(this.camera, canvas);
    Object.assign(this.controls, { enableDamping: true, dampingFactor: 0.12, minDistance: 0.2, maxDistance: 12 });
    this.controls.addEventListener("change", () => (this.dirty = true));
    this.share = 1;
    this.frame = this.drawn = this.before = 0;
    this.dirty = true;
    this.addLights();
    this.addBox();
    this.smoke = facts.smoke ? new Smoke(facts.smoke, TO_LIGHT) : null;
    this.resetCamera();
  }

  async load() {
    const uniforms = {
      volume: { value: this.smoke ? this.smoke.texture : this.emptyVolume() },
      toVolume: { value: this.smoke ? this.smoke.toVolume : new THREE.Matrix4() },
      inSmoke: { value: this.smoke && !this.facts.smoke.flat ? 1 : 0 },
      ground: { value: this.low.y },
    };
    this.items = [];
    for (const item of this.facts.items) {
      const made = await makeItem(item, this.facts.frames.length, uniforms);
      this.items.push(made);
      this.scene.add(made.object);
    }
    if (this.smoke) await this.smoke.load(0);
  }

  emptyVolume() {
    const texture = new THREE.Data3DTexture(new Uint8Array([0, 255]), 1, 1, 1);
    Object.assign(texture, { format: THREE.RGFormat, needsUpdate: true, unpackAlignment: 1 });
    return texture;
  }

  addLights() {
    const corners = this.facts.box.map((corner) => new THREE.Vector3(...corner));
    const bounds = new THREE.Box3().setFromPoints(corners);
    [this.low, this.high] = [bounds.min, bounds.max];
    this.center = bounds.getCenter(new THREE.Vector3());
    this.radius = bounds.getSize(new THREE.Vector3()).length() / 2;
    const lamp = new THREE.DirectionalLight(0xfff1de, 2.6);
    lamp.position.copy(this.center).addScaledVector(TO_LIGHT, 3);
    lamp.target.position.copy(this.center);
    lamp.castShadow = true;
    lamp.shadow.mapSize.set(1024, 1024);
    lamp.shadow.radius = 5;
    lamp.shadow.blurSamples = 12;
    lamp.shadow.bias = -0.0006;
    lamp.shadow.normalBias = 0.006;
    const reach = 1.15 * this.radius;
    Object.assign(lamp.shadow.camera, { left: -reach, right: reach, top: reach, bottom: -reach, near: 0.5, far: 6 });
    const back = new THREE.DirectionalLight(0xa9c4ff, 0.9);
    back.position.set(1.2, 0.5, -1.4);
    this.scene.add(lamp, lamp.target, back, new THREE.HemisphereLight(0xd3def0, 0x8a8078, 1.25));
  }

  addBox() {
    const edges = [];
    for (let a = 0; a < 8; ++a) for (const bit of [1, 2, 4]) if (!(a & bit)) edges.push(a, a | bit);
    const points = edges.flatMap((corner) => this.facts.box[corner]);
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
    const faint = { color: 0x9fb2cc, transparent: true, opacity: 0.22, depthWrite: false };
    this.box = new THREE.LineSegments(geometry, new THREE.LineBasicMaterial(faint));
    this.scene.add(this.box);
    if (this.facts.flat) return;
    const plane = new THREE.CircleGeometry(2.2, 64).rotateX(-Math.PI / 2);
    const floor = new THREE.Mesh(plane, new THREE.MeshBasicMaterial({ map: pool(), transparent: true, depthWrite: false }));
    const shadow = new THREE.Mesh(plane, new THREE.ShadowMaterial({ opacity: 0.55, depthWrite: false }));
    floor.position.set(this.center.x, this.low.y - 0.004, this.center.z);
    shadow.position.set(this.center.x, this.low.y - 0.003, this.center.z);
    shadow.receiveShadow = true;
    [floor.renderOrder, shadow.renderOrder] = [-2, -1];
    this.scene.add(floor, shadow);
  }

  resetCamera() {
    const direction = this.facts.flat ? new THREE.Vector3(...this.facts.flat) : new THREE.Vector3(0.5, 0.3, 1);
    this.controls.target.copy(this.center);
    const distance = this.distanceThatFits(direction.normalize());
    this.camera.position.copy(this.center).addScaledVector(direction, distance);
    this.controls.update();
    this.dirty = true;
  }

  /** From the middle of the box, so that all of it is between the margins. */
  distanceThatFits(direction) {
    const side = new THREE.Vector3(0, 1, 0).cross(direction).normalize();
    const up = new THREE.Vector3().crossVectors(direction, side);
    const half = Math.tan((this.camera.fov * Math.PI) / 360);
    const free = 1 - (MARGIN_TOP + MARGIN_BOTTOM) / Math.max(this.height || 720, 300);
    let distance = 0.3;
    for (const corner of this.facts.box) {
      const from = new THREE.Vector3(...corner).sub(this.center);
      const wide = Math.abs(from.dot(side)) / (0.92 * half * (this.camera.aspect || 1));
      const high = Math.abs(from.dot(up)) / (free * half);
      distance = Math.max(distance, from.dot(direction) + Math.max(wide, high));
    }
    return distance;
  }

  orbit(angle, lift) {
    const away = new THREE.Spherical().setFromVector3(this.camera.position.clone().sub(this.controls.target));
    away.theta += angle;
    away.phi = Math.min(Math.max(away.phi + lift, 0.05), Math.PI - 0.05);
    this.camera.position.setFromSpherical(away).add(this.controls.target);
    this.controls.update();
    this.dirty = true;
  }

  zoom(factor) {
    this.camera.position.sub(this.controls.target).multiplyScalar(factor).add(this.controls.target);
    this.controls.update();
    this.dirty = true;
  }

  /** Shows a frame once its smoke is there. False where another one was asked for in the meantime. */
  async show(frame) {
    this.frame = frame;
    if (this.smoke && !this.smoke.has(frame)) await this.smoke.load(frame);
    if (this.frame !== frame) return false;
    for (const item of this.items) item.show(frame);
    if (this.smoke) this.smoke.show(frame, this.items);
    this.dirty = true;
    return true;
  }

  /** Draws where something has changed. now: time of this picture; a slow one before it makes the smoke coarser. */
  draw(now = 0) {
    this.controls.update();
    this.resize();
    const late = this.drawn > 2 && now - this.before > SLOW; // the first ones compile shaders
    if (late && this.share > 0.3 && this.drew) this.share *= 0.7;
    [this.before, this.drew] = [now, this.dirty];
    if (!this.dirty) return;
    this.dirty = false;
    ++this.drawn;
    this.renderer.render(this.scene, this.camera);
    if (this.smoke) {
      const shown = this.box.visible;
      this.box.visible = false; // its lines must not hide smoke
      this.smoke.draw(this.renderer, this.scene, this.camera, this.share);
      this.box.visible = shown;
    }
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    if (width === this.width && height === this.height && ratio === this.ratio) return;
    const first = this.width === undefined;
    Object.assign(this, { width, height, ratio });
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / Math.max(height, 1);
    this.camera.setViewOffset(width, height, 0, (MARGIN_BOTTOM - MARGIN_TOP) / 2, width, height);
    if (first) this.resetCamera();
    this.dirty = true;
  }
}

/** A pool of light on the floor that fades away. */
function pool() {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 256;
  const pen = canvas.getContext("2d");
  const fade = pen.createRadialGradient(128, 128, 0, 128, 128, 128);
  fade.addColorStop(0, "rgba(150,164,186,0.42)");
  fade.addColorStop(0.35, "rgba(128,142,166,0.26)");
  fade.addColorStop(1, "rgba(100,112,134,0)");
  pen.fillStyle = fade;
  pen.fillRect(0, 0, 256, 256);
  const texture = new THREE.CanvasTexture(canvas);
  texture.colorSpace = THREE.SRGBColorSpace;
  return texture;
}
