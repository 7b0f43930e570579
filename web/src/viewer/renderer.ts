// The only file that draws: one model with three.js. It keeps the model's arrays, so that a lost context can be filled again.
import {
  BufferAttribute,
  BufferGeometry,
  Color,
  DoubleSide,
  Matrix4,
  Mesh,
  PerspectiveCamera,
  Points,
  Scene,
  ShaderMaterial,
  Vector3,
  WebGLRenderer,
} from "three";
import { type Bounds, basis, center, eye, FIELD_OF_VIEW, type Orbit, radius } from "../math/orbit";
import { length, sub, type Vec3 } from "../math/vec3";
import { MESH_FRAGMENT, MESH_VERTEX, POINT_FRAGMENT, POINT_VERTEX } from "./shaders";
import { LANES, type Model, type StreamHeader } from "./stream";

/** A plain backdrop, as behind the things in a photograph. */
export const BACKDROP = "#eef1ee";
const MAX_PIXEL_RATIO = 2;
/** Points overlap a little, so that a surface looks closed. */
const POINT_OVERLAP = 1.9;

export class Renderer {
  readonly #gl: WebGLRenderer;
  readonly #scene = new Scene();
  readonly #camera = new PerspectiveCamera((FIELD_OF_VIEW * 180) / Math.PI);
  // The same arrays twice: points are drawn in their order, triangles by their indices.
  readonly #points = new Points(new BufferGeometry(), material(POINT_VERTEX, POINT_FRAGMENT));
  readonly #mesh = new Mesh(new BufferGeometry(), material(MESH_VERTEX, MESH_FRAGMENT));
  #bounds: Bounds;
  #surface = 0;
  #uploadedPoints = 0;
  #heightPx = 1;

  constructor(
    canvas: HTMLCanvasElement,
    context: WebGL2RenderingContext,
    header: StreamHeader,
    model: Model,
  ) {
    this.#gl = new WebGLRenderer({ canvas, context });
    this.#bounds = header;
    // Part of the scene, not of the context: it survives the context's loss.
    this.#scene.background = new Color(BACKDROP);
    this.useModel(header, model);
    for (const object of [this.#points, this.#mesh]) {
      // Three.js would work out a bounding sphere from the quantised numbers.
      object.frustumCulled = false;
      this.#scene.add(object);
    }
    this.#camera.matrixAutoUpdate = false;
  }

  /** Draws from these arrays from now on; they may still be filling up. */
  useModel(header: StreamHeader, { positions, colors, normals, indices }: Model): void {
    this.#uploadedPoints = 0;
    this.#bounds = header;
    this.#surface = roughSurface(header);
    const attributes = { position: positions, color: colors, direction: normals };
    const buffers = Object.entries(attributes).map(
      ([name, array]) => [name, new BufferAttribute(array, LANES, true)] as const,
    );
    for (const { position, scale, geometry, material } of [this.#points, this.#mesh]) {
      geometry.dispose();
      position.set(...header.min);
      scale.set(...sub(header.max, header.min));
      setUniform(material, "hasNormals", header.hasNormals ? 1 : 0);
      for (const [name, buffer] of buffers) {
        if (buffer.array.length > 0) geometry.setAttribute(name, buffer);
        else geometry.deleteAttribute(name);
      }
    }
    this.#mesh.geometry.setIndex(new BufferAttribute(indices, 1));
  }

  /** Takes over the points decoded since the last call. */
  addPoints(ready: number): void {
    if (ready === this.#uploadedPoints) return;
    for (const attribute of Object.values(this.#points.geometry.attributes)) {
      if (!(attribute instanceof BufferAttribute)) continue;
      attribute.addUpdateRange(this.#uploadedPoints * LANES, (ready - this.#uploadedPoints) * LANES);
      attribute.needsUpdate = true;
    }
    this.#uploadedPoints = ready;
  }

  /** Takes over colours and marks that were changed in place. */
  refreshColors(): void {
    const { color } = this.#points.geometry.attributes;
    if (!(color instanceof BufferAttribute)) return;
    color.clearUpdateRanges();
    color.needsUpdate = true;
  }

  resize(width: number, height: number): void {
    const ratio = Math.min(window.devicePixelRatio, MAX_PIXEL_RATIO);
    this.#gl.setPixelRatio(ratio);
    this.#gl.setSize(width, height, false);
    this.#heightPx = height * ratio;
    this.#camera.aspect = width / height;
  }

  /** Draws the first `count` points or triangles. */
  render(orbit: Orbit, kind: StreamHeader["kind"], count: number, pointScale: number): void {
    this.#points.visible = kind === "points";
    this.#mesh.visible = kind === "mesh";
    if (kind === "mesh") {
      this.#mesh.geometry.setDrawRange(0, count * 3);
    } else {
      this.#points.geometry.setDrawRange(0, count);
      const spacing = Math.sqrt(this.#surface / Math.max(1, count));
      const size = Math.min(spacing * POINT_OVERLAP, radius(this.#bounds) * 0.06) * pointScale;
      setUniform(this.#points.material, "worldSize", size);
      const perUnit = this.#heightPx / (2 * Math.tan(FIELD_OF_VIEW / 2));
      setUniform(this.#points.material, "pixelsPerUnit", perUnit);
    }
    this.#placeCamera(orbit);
    this.#gl.render(this.#scene, this.#camera);
  }

  /** Everything the graphics card holds is given back, the context too. */
  dispose(): void {
    for (const { geometry, material } of [this.#points, this.#mesh]) {
      geometry.dispose();
      material.dispose();
    }
    this.#gl.dispose();
    this.#gl.forceContextLoss();
  }

  #placeCamera(orbit: Orbit): void {
    const { right, up, forward } = basis(orbit);
    const place = eye(orbit);
    this.#camera.matrix
      .copy(new Matrix4().makeBasis(vector(right), vector(up), vector(forward).negate()))
      .setPosition(...place);
    const toMiddle = length(sub(center(this.#bounds), place));
    const reach = radius(this.#bounds) * 1.05;
    this.#camera.near = Math.max(reach * 0.01, toMiddle - reach);
    this.#camera.far = Math.max(this.#camera.near * 2, toMiddle + reach);
    this.#camera.updateProjectionMatrix();
    this.#camera.updateMatrixWorld(true);
  }
}

function material(vertexShader: string, fragmentShader: string): ShaderMaterial {
  const uniforms = { hasNormals: { value: 0 }, worldSize: { value: 0 }, pixelsPerUnit: { value: 1 } };
  return new ShaderMaterial({ vertexShader, fragmentShader, side: DoubleSide, uniforms });
}

function setUniform({ uniforms }: ShaderMaterial, name: string, value: number): void {
  const uniform = uniforms[name];
  if (uniform) uniform.value = value;
}

function vector(v: Vec3): Vector3 {
  return new Vector3(...v);
}

/** Square metres of surface, good enough to choose the size of points: most of the box round the product. */
function roughSurface({ min, max }: Bounds): number {
  const [x, y, z] = sub(max, min);
  return Math.max(1e-12, 1.6 * (x * y + y * z + z * x));
}
