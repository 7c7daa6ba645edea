// A 3D view of coloured points. All scenes share one camera if they are linked; every cloud is
// shown around its middle, so that an object stays in view from frame to frame.
import {
  BufferAttribute, BufferGeometry, Color, ColorManagement, LinearSRGBColorSpace, PerspectiveCamera,
  Points, Scene as ThreeScene, ShaderMaterial, Sphere, Vector3, WebGLRenderer,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { quantile } from "./numbers";

ColorManagement.enabled = false; // colours are shown as they are given

const kFov = 35;

const kVertex = `
  attribute vec3 tint;
  uniform float size;
  uniform float middle;
  uniform float radius;
  varying vec3 colour;
  varying float depth;
  void main() {
    vec4 eye = modelViewMatrix * vec4(position, 1.0);
    gl_Position = projectionMatrix * eye;
    gl_PointSize = max(1.5, size / -eye.z);
    colour = tint;
    depth = clamp(0.5 + 0.5 * (-eye.z - middle) / radius, 0.0, 1.0);
  }`;
const kFragment = `
  uniform vec3 background;
  varying vec3 colour;
  varying float depth;
  void main() {
    vec2 offset = 2.0 * gl_PointCoord - 1.0;
    float inside = dot(offset, offset);
    if (inside > 1.0) discard;
    gl_FragColor = vec4(mix(colour * (1.0 - 0.18 * inside), background, 0.35 * depth), 1.0);
  }`;

export class Scene {
  readonly canvas: HTMLCanvasElement;
  onCamera: (scene: Scene) => void = () => {};
  onPick: (point: number | null) => void = () => {};

  private readonly renderer: WebGLRenderer;
  private readonly scene = new ThreeScene();
  private readonly camera = new PerspectiveCamera(kFov, 1, 0.001, 1000);
  private readonly controls: OrbitControls;
  private readonly material: ShaderMaterial;
  private points: Points | null = null;
  private middle = new Vector3();
  private radius = 0;
  private spacing = 0.01;
  private sizeFactor = 1;
  private dirty = true;
  private quiet = false;

  constructor(container: HTMLElement) {
    this.renderer = new WebGLRenderer({ antialias: true, powerPreference: "high-performance" });
    this.renderer.outputColorSpace = LinearSRGBColorSpace;
    this.renderer.setPixelRatio(Math.min(2, window.devicePixelRatio));
    this.canvas = this.renderer.domElement;
    container.append(this.canvas);
    this.material = new ShaderMaterial({
      vertexShader: kVertex,
      fragmentShader: kFragment,
      uniforms: { size: { value: 1 }, middle: { value: 1 }, radius: { value: 1 },
        background: { value: new Color() } },
    });
    this.camera.up.set(0, -1, 0); // of the sensor's frame, whose y points down
    this.controls = new OrbitControls(this.camera, this.canvas);
    this.controls.enableDamping = false;
    this.controls.addEventListener("change", () => {
      this.dirty = true;
      if (!this.quiet) this.onCamera(this);
    });
    new ResizeObserver(() => this.resize(container)).observe(container);
    this.listenForClicks();
  }

  dispose(): void {
    this.points?.geometry.dispose();
    this.material.dispose();
    this.controls.dispose();
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }

  // Points without coordinates are left out. The arrays must not change any more.
  show(xyz: Float32Array | null, colour: Uint8Array, origin: ArrayLike<number>): void {
    if (this.points !== null) {
      this.scene.remove(this.points);
      this.points.geometry.dispose();
      this.points = null;
    }
    this.dirty = true;
    if (xyz === null || xyz.length === 0) return;
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(xyz, 3));
    geometry.setAttribute("tint", new BufferAttribute(colour, 3, true));
    const { middle, radius } = extent(xyz);
    geometry.boundingSphere = new Sphere(middle, radius); // else it is computed of all points
    this.middle = middle;
    this.spacing = (2.5 * radius) / Math.sqrt(xyz.length / 3);
    this.points = new Points(geometry, this.material);
    this.points.frustumCulled = false;
    this.points.position.copy(middle).negate();
    this.scene.add(this.points);
    if (this.radius === 0) this.fit(origin, radius);
  }

  // Looks at everything from where the sensor is.
  fit(origin: ArrayLike<number>, radius = this.points === null ? 1 : extent(
    this.points.geometry.getAttribute("position").array as Float32Array).radius): void {
    this.radius = radius;
    const toSensor = new Vector3(origin[0], origin[1], origin[2]).sub(this.middle);
    if (toSensor.lengthSq() === 0) toSensor.set(0, 0, -1);
    const distance = (1.06 * radius) / Math.sin((kFov * Math.PI) / 360);
    this.camera.position.copy(toSensor.setLength(distance));
    this.controls.target.set(0, 0, 0);
    this.controls.update();
    this.dirty = true;
    if (!this.quiet) this.onCamera(this);
  }

  follow(other: Scene): void {
    this.quiet = true;
    this.radius = other.radius;
    this.camera.position.copy(other.camera.position);
    this.controls.target.copy(other.controls.target);
    this.controls.update();
    this.quiet = false;
    this.dirty = true;
  }

  hasView(): boolean {
    return this.radius > 0;
  }

  // Steps of turning and zooming, for the keyboard.
  turn(horizontal: number, vertical: number, zoom: number): void {
    const offset = this.camera.position.clone().sub(this.controls.target);
    const up = this.camera.up.clone().normalize();
    offset.applyAxisAngle(up, horizontal);
    const side = new Vector3().crossVectors(up, offset).normalize();
    const tilted = offset.clone().applyAxisAngle(side, vertical);
    const angle = tilted.angleTo(up);
    if (angle > 0.1 && angle < Math.PI - 0.1) offset.copy(tilted);
    this.camera.position.copy(this.controls.target).add(offset.multiplyScalar(zoom));
    this.controls.update();
  }

  setSize(factor: number): void {
    this.sizeFactor = factor;
    this.dirty = true;
  }

  setBackground(colour: string): void {
    const value = new Color(colour);
    this.renderer.setClearColor(value);
    this.material.uniforms.background.value = value;
    this.dirty = true;
  }

  // Draws if something has changed.
  draw(): void {
    if (!this.dirty) return;
    this.dirty = false;
    const distance = this.camera.position.distanceTo(this.controls.target);
    // The narrower side has the angle, so that what fits into a wide pane fits into a tall one.
    const half = Math.tan((kFov * Math.PI) / 360) / Math.min(1, this.camera.aspect);
    this.camera.fov = (360 / Math.PI) * Math.atan(half);
    this.camera.near = distance / 200;
    this.camera.far = 20 * distance + 20 * this.radius;
    this.camera.updateProjectionMatrix();
    const height = this.renderer.domElement.height;
    const focal = height / (2 * half);
    this.material.uniforms.size.value = this.sizeFactor * this.spacing * focal;
    this.material.uniforms.middle.value = distance;
    this.material.uniforms.radius.value = this.radius || 1;
    this.renderer.render(this.scene, this.camera);
  }

  private resize(container: HTMLElement): void {
    const { width, height } = container.getBoundingClientRect();
    if (width === 0 || height === 0) return;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.dirty = true;
    this.draw(); // at once: a resized canvas is blank
  }

  private listenForClicks(): void {
    let down: [number, number] | null = null;
    this.canvas.addEventListener("pointerdown", (event) => (down = [event.clientX, event.clientY]));
    this.canvas.addEventListener("pointerup", (event) => {
      if (down === null) return;
      const moved = Math.hypot(event.clientX - down[0], event.clientY - down[1]);
      if (moved < 4) this.onPick(this.pointAt(event.clientX, event.clientY));
      down = null;
    });
  }

  // The nearest to the eye of the points around a place on the screen.
  private pointAt(clientX: number, clientY: number): number | null {
    if (this.points === null) return null;
    const box = this.canvas.getBoundingClientRect();
    const reach = 8;
    const xyz = this.points.geometry.getAttribute("position").array;
    this.camera.updateMatrixWorld();
    const at = new Vector3();
    let best: number | null = null;
    let nearest = Infinity;
    for (let i = 0; i < xyz.length / 3; ++i) {
      at.set(xyz[3 * i], xyz[3 * i + 1], xyz[3 * i + 2]).sub(this.middle).project(this.camera);
      const x = box.left + (0.5 + 0.5 * at.x) * box.width;
      const y = box.top + (0.5 - 0.5 * at.y) * box.height;
      if (Math.hypot(x - clientX, y - clientY) > reach || !(at.z < nearest)) continue;
      nearest = at.z;
      best = i;
    }
    return best;
  }
}

// Middle and radius of nearly all points.
function extent(xyz: Float32Array): { middle: Vector3; radius: number } {
  const step = 3 * Math.max(1, Math.floor(xyz.length / 3 / 4000));
  const axis = (a: number) => {
    const values = [];
    for (let i = a; i < xyz.length; i += step) values.push(xyz[i]);
    return 0.5 * (quantile(values, 0.002) + quantile(values, 0.998));
  };
  const middle = new Vector3(axis(0), axis(1), axis(2));
  const distances = [];
  for (let i = 0; i < xyz.length; i += step)
    distances.push(Math.hypot(xyz[i] - middle.x, xyz[i + 1] - middle.y, xyz[i + 2] - middle.z));
  return { middle, radius: quantile(distances, 0.995) || 1 };
}
