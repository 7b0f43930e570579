// Shaders for points and meshes. Positions arrive as 0..1 between min and max; the model matrix turns them into metres.
// Colours are sRGB and stay so: what was scanned is what is shown, with a little shading from a light at the viewer's shoulder.

const LIGHT = `
  const vec3 LIGHT = normalize(vec3(-0.35, 0.5, 0.8));
  float shade(vec3 normalInView) {
    return 0.66 + 0.38 * abs(dot(normalInView, LIGHT));
  }`;

/** Invented surface is paler and striped, so that nobody takes it for measured. */
const INVENTED = `
  vec3 asInvented(vec3 color) {
    float stripe = step(0.5, fract((gl_FragCoord.x + gl_FragCoord.y) / 9.0));
    return mix(color, vec3(0.62, 0.66, 0.7), 0.45 + 0.35 * stripe);
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
  varying float vInvented;
  ${LIGHT}
  void main() {
    vec4 inView = viewMatrix * modelMatrix * vec4(position, 1.0);
    gl_Position = projectionMatrix * inView;
    gl_PointSize = clamp(worldSize * pixelsPerUnit / max(1e-6, -inView.z), 1.5, 64.0);
    float light = hasNormals > 0.5 ? shade(normalize(mat3(viewMatrix) * direction)) : 1.0;
    vColor = (color.a > 0.25 ? color.rgb : ${MARK}) * light;
    vInvented = color.a > 0.25 && color.a < 0.75 ? 1.0 : 0.0;
  }`;

export const POINT_FRAGMENT = `
  varying vec3 vColor;
  varying float vInvented;
  ${INVENTED}
  void main() {
    vec2 fromMiddle = gl_PointCoord - 0.5;
    if (dot(fromMiddle, fromMiddle) > 0.25) discard;
    gl_FragColor = vec4(vInvented > 0.5 ? asInvented(vColor) : vColor, 1.0);
  }`;

export const MESH_VERTEX = `
  attribute vec4 color;
  attribute vec3 direction;
  varying vec3 vColor;
  varying vec3 vInView;
  varying vec3 vNormal;
  varying float vInvented;
  void main() {
    vec4 inView = viewMatrix * modelMatrix * vec4(position, 1.0);
    gl_Position = projectionMatrix * inView;
    vColor = color.a > 0.25 ? color.rgb : ${MARK};
    vInvented = color.a > 0.25 && color.a < 0.75 ? 1.0 : 0.0;
    vInView = inView.xyz;
    vNormal = mat3(viewMatrix) * direction;
  }`;

export const MESH_FRAGMENT = `
  uniform float hasNormals;
  varying vec3 vColor;
  varying vec3 vInView;
  varying vec3 vNormal;
  varying float vInvented;
  ${LIGHT}
  ${INVENTED}
  void main() {
    vec3 normal = hasNormals > 0.5 ? vNormal : cross(dFdx(vInView), dFdy(vInView));
    // a triangle with one invented corner is invented
    vec3 color = vInvented > 0.01 ? asInvented(vColor) : vColor;
    gl_FragColor = vec4(color * shade(normalize(normal)), 1.0);
  }`;
