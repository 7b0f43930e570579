// Shaders for points and meshes. Positions arrive as 0..1 between min and max; the model matrix turns them into metres.
// Colours are sRGB and stay so: what was scanned is what is shown, with a little shading from a light at the viewer's shoulder.

const LIGHT = `
  const vec3 LIGHT = normalize(vec3(-0.35, 0.5, 0.8));
  float shade(vec3 normalInView) {
    return 0.66 + 0.38 * abs(dot(normalInView, LIGHT));
  }`;

/** Marked points are drawn in this colour whatever their own, with the shading that shows their shape. */
const MARK = "vec3(0.93, 0.07, 0.55)";

export const POINT_VERTEX = `
  attribute vec4 color;
  attribute vec3 direction;
  uniform float worldSize;
  uniform float pixelsPerUnit;
  uniform float hasNormals;
  varying vec3 vColor;
  ${LIGHT}
  void main() {
    vec4 inView = viewMatrix * modelMatrix * vec4(position, 1.0);
    gl_Position = projectionMatrix * inView;
    gl_PointSize = clamp(worldSize * pixelsPerUnit / max(1e-6, -inView.z), 1.5, 64.0);
    float light = hasNormals > 0.5 ? shade(normalize(mat3(viewMatrix) * direction)) : 1.0;
    vColor = (color.a > 0.5 ? color.rgb : ${MARK}) * light;
  }`;

export const POINT_FRAGMENT = `
  varying vec3 vColor;
  void main() {
    vec2 fromMiddle = gl_PointCoord - 0.5;
    if (dot(fromMiddle, fromMiddle) > 0.25) discard;
    gl_FragColor = vec4(vColor, 1.0);
  }`;

export const MESH_VERTEX = `
  attribute vec3 color;
  attribute vec3 direction;
  varying vec3 vColor;
  varying vec3 vInView;
  varying vec3 vNormal;
  void main() {
    vec4 inView = viewMatrix * modelMatrix * vec4(position, 1.0);
    gl_Position = projectionMatrix * inView;
    vColor = color;
    vInView = inView.xyz;
    vNormal = mat3(viewMatrix) * direction;
  }`;

export const MESH_FRAGMENT = `
  uniform float hasNormals;
  varying vec3 vColor;
  varying vec3 vInView;
  varying vec3 vNormal;
  ${LIGHT}
  void main() {
    vec3 normal = hasNormals > 0.5 ? vNormal : cross(dFdx(vInView), dFdy(vInView));
    gl_FragColor = vec4(vColor * shade(normalize(normal)), 1.0);
  }`;
