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
  readonly #geometry = new BufferGeometry();
  readonly #material: ShaderMaterial;
  readonly #isMesh: boolean;
  readonly #object: Points | Mesh;
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
    this.#isMesh = header.kind === "mesh";
    // Part of the scene, not of the context: it survives the context's loss.
    this.#scene.background = new Color(BACKDROP);
    this.#material = this.#makeMaterial();
    this.#object = this.#makeObject();
    this.useModel(header, model);
    this.#scene.add(this.#object);
    this.#camera.matrixAutoUpdate = false;
  }

  /** Draws from these arrays from now on; they may still be filling up. Points stay points, and a mesh a mesh. */
  useModel(header: StreamHeader, { positions, colors, normals, indices }: Model): void {
    const geometry = this.#geometry;
    geometry.dispose();
    this.#uploadedPoints = 0;
    this.#bounds = header;
    this.#surface = roughSurface(header);
    this.#object.position.set(...header.min);
    this.#object.scale.set(...sub(header.max, header.min));
    this.#setUniform("hasNormals", header.hasNormals ? 1 : 0);
    geometry.setAttribute("position", new BufferAttribute(positions, LANES, true));
    geometry.setAttribute("color", new BufferAttribute(colors, LANES, true));
    if (normals.length > 0) geometry.setAttribute("direction", new BufferAttribute(normals, LANES, true));
    else geometry.deleteAttribute("direction");
    if (this.#isMesh) geometry.setIndex(new BufferAttribute(indices, 1));
  }

  /** Takes over the points decoded since the last call. */
  addPoints(ready: number): void {
    if (ready === this.#uploadedPoints) return;
    for (const attribute of Object.values(this.#geometry.attributes)) {
      if (!(attribute instanceof BufferAttribute)) continue;
      attribute.addUpdateRange(this.#uploadedPoints * LANES, (ready - this.#uploadedPoints) * LANES);
      attribute.needsUpdate = true;
    }
    this.#uploadedPoints = ready;
  }

  /** Takes over colours and marks that were changed in place. */
  refreshColors(): void {
    const { color } = this.#geometry.attributes;
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

  /** Draws the first `count` points, or triangles of a mesh. */
  render(orbit: Orbit, count: number, pointScale: number): void {
    this.#geometry.setDrawRange(0, this.#isMesh ? count * 3 : count);
    if (!this.#isMesh) {
      const spacing = Math.sqrt(this.#surface / Math.max(1, count));
      this.#setUniform(
        "worldSize",
        Math.min(spacing * POINT_OVERLAP, radius(this.#bounds) * 0.06) * pointScale,
      );
      this.#setUniform("pixelsPerUnit", this.#heightPx / (2 * Math.tan(FIELD_OF_VIEW / 2)));
    }
    this.#placeCamera(orbit);
    this.#gl.render(this.#scene, this.#camera);
  }

  /** Everything the graphics card holds is given back, the context too. */
  dispose(): void {
    this.#geometry.dispose();
    this.#material.dispose();
    this.#gl.dispose();
    this.#gl.forceContextLoss();
  }

  #setUniform(name: string, value: number): void {
    const uniform = this.#material.uniforms[name];
    if (uniform) uniform.value = value;
  }

  #makeMaterial(): ShaderMaterial {
    return new ShaderMaterial({
      vertexShader: this.#isMesh ? MESH_VERTEX : POINT_VERTEX,
      fragmentShader: this.#isMesh ? MESH_FRAGMENT : POINT_FRAGMENT,
      side: DoubleSide,
      uniforms: {
        hasNormals: { value: 0 },
        worldSize: { value: 0 },
        pixelsPerUnit: { value: 1 },
      },
    });
  }

  #makeObject(): Points | Mesh {
    const object = this.#isMesh
      ? new Mesh(this.#geometry, this.#material)
      : new Points(this.#geometry, this.#material);
    // Three.js would work out a bounding sphere from the quantised numbers.
    object.frustumCulled = false;
    return object;
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

function vector(v: Vec3): Vector3 {
  return new Vector3(...v);
}

/** Square metres of surface, good enough to choose the size of points: most of the box round the product. */
function roughSurface({ min, max }: Bounds): number {
  const [x, y, z] = sub(max, min);
  return Math.max(1e-12, 1.6 * (x * y + y * z + z * x));
}
