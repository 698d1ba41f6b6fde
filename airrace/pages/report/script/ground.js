// Sky, sun, water and land around the course, and shadows on it: shaders that read one texture of noise, whose mipmaps
// leave no moiré; shapes laid flat along the sun's rays, each spot darkened once.

import {
  BackSide,
  CircleGeometry,
  Color,
  DataTexture,
  Group,
  LinearFilter,
  LinearMipmapNearestFilter,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  NotEqualStencilFunc,
  PlaneGeometry,
  RepeatWrapping,
  ReplaceStencilOp,
  ShaderMaterial,
  Shape,
  ShapeGeometry,
  SphereGeometry,
  Vector2,
  Vector3,
  WebGLRenderTarget,
} from "three";
import { placed } from "./flight.js";
import { roundStep, themed } from "./values.js";

const FAR = 55000; // m, the radius of the ground
const LINES = 14; // of the grid, about, along the longer side of the course
const ABOVE_SEA = 1; // m: a course that lies lower is flown over water, unless it is chosen otherwise
const SUN = [-0.52, 0.66, 0.54]; // towards the sun, in the scene's axes: an afternoon of the northern hemisphere
const TEXELS = 256;
const OCTAVES = 5;
const COARSE = 2; // pixels, along each side, of those in which sky and ground are drawn: their shaders take most of a picture's time

/** The direction to the sun; south of the equator it stands in the north. */
function sunOf(latitude) {
  return new Vector3(SUN[0], SUN[1], latitude < 0 ? -SUN[2] : SUN[2]).normalize();
}

/** Sky, ground and grid around a box in the scene; `step` is the grid's, in metres, and `restyle()` repaints. */
export function groundOf(box, course) {
  const group = new Group();
  const sun = sunOf(course.latitude ?? 0);
  const extent = Math.max(box.max.x - box.min.x, box.max.z - box.min.z, 200);
  const shore = shoreOf(box, course, extent);
  const uniforms = {
    noise: { value: noiseTexture() },
    sun: { value: sun },
    sunlight: { value: new Color() },
    shore: { value: shore },
    water: { value: 0 },
    time: { value: 0 },
    haze: { value: 1 },
    grid: { value: 0 },
    spacing: { value: roundStep(extent / LINES) },
  };
  for (const name of COLOURS) uniforms[name.replace("-", "_")] = { value: new Color() };
  const shaded = (vertexShader, fragmentShader, options) =>
    new ShaderMaterial({ uniforms, vertexShader, fragmentShader, depthWrite: false, ...options });
  const sky = new Mesh(new SphereGeometry(9000, 32, 24, 0, 2 * Math.PI, 0, 0.52 * Math.PI), shaded(SKY_VERTEX, SKY_FRAGMENT, { side: BackSide, depthTest: false }));
  sky.renderOrder = -30;
  const plain = new Mesh(new CircleGeometry(FAR, 64), shaded(GROUND_VERTEX, GROUND_FRAGMENT));
  plain.rotation.x = -Math.PI / 2;
  plain.renderOrder = -20;
  const backdrop = new Group().add(sky, plain);
  const coarse = coarselyDrawn(backdrop);
  const arrow = northArrow(box, extent);
  group.add(backdrop, coarse, arrow);
  Object.assign(group, { step: uniforms.spacing.value, arrow, sun, shore });
  group.flood = (kind) => {
    group.kind = kind;
    uniforms.water.value = kind === "water" ? 1 : 0;
  };
  group.flood(course.elevation !== null && course.elevation < ABOVE_SEA ? "water" : "grass");
  /** Fit it to a camera and an instant; `drawn` is whether grid and arrow belong into the picture. */
  group.show = (camera, time, drawn) => {
    const flat = camera.isOrthographicCamera === true;
    sky.position.copy(camera.position).multiplyScalar(flat ? 0 : 1);
    uniforms.haze.value = flat ? 0 : 1;
    uniforms.grid.value = drawn ? 1 : 0;
    uniforms.time.value = time;
    arrow.visible = drawn;
  };
  /** Draw sky and ground ahead of a picture where the latter has no grid, whose lines have to be fine; or `apart` from it. */
  group.prepare = (renderer, camera, apart) => coarse.prepare(renderer, camera, uniforms.grid.value === 0, apart);
  group.drawOn = coarse.drawOn;
  group.restyle = () => {
    for (const name of COLOURS) uniforms[name.replace("-", "_")].value.set(themed(name));
    uniforms.sunlight.value.set(themed("sunlight"));
    arrow.material.color.set(themed("cloud"));
  };
  return group;
}

/**
 * What shows a backdrop that `prepare(renderer, camera, isCoarse, apart)` draws ahead in coarse pixels, or lets be drawn in
 * full. Where it is to be apart, the scene leaves it out, and `drawOn(context, renderer, width, height)` draws it in a picture
 * below the scene: a processor makes fine pixels of coarse ones ten times as fast there as with several samples each.
 */
function coarselyDrawn(backdrop) {
  const target = new WebGLRenderTarget(1, 1, { depthBuffer: false });
  const uniforms = { drawn: { value: target.texture } };
  const look = { depthTest: false, depthWrite: false };
  const material = new ShaderMaterial({ uniforms, vertexShader: WHOLE_VERTEX, fragmentShader: DRAWN_FRAGMENT, ...look });
  const shown = new Mesh(new PlaneGeometry(2, 2), material);
  Object.assign(shown, { frustumCulled: false, renderOrder: -30 });
  const sheet = document.createElement("canvas").getContext("2d");
  shown.drawOn = (context, renderer, width, height) => {
    const image = new ImageData(target.width, target.height);
    renderer.readRenderTargetPixels(target, 0, 0, target.width, target.height, image.data);
    Object.assign(sheet.canvas, { width: target.width, height: target.height });
    sheet.putImageData(image, 0, 0);
    context.save();
    context.scale(1, -1); // rows of a target begin at the foot
    context.drawImage(sheet.canvas, 0, -height, width, height);
    context.restore();
  };
  shown.prepare = (renderer, camera, isCoarse, apart) => {
    backdrop.visible = true;
    if (isCoarse) {
      const size = renderer.getDrawingBufferSize(new Vector2());
      target.setSize(Math.ceil(size.x / COARSE), Math.ceil(size.y / COARSE));
      renderer.setRenderTarget(target);
      renderer.render(backdrop, camera);
      renderer.setRenderTarget(null);
    }
    backdrop.visible = !isCoarse;
    shown.visible = isCoarse && !apart;
  };
  return shown;
}

/**
 * Where the water ends, as a half plane (x, z, offset) whose positive side is land: before the people, else behind the
 * safety lines, else beyond the course. It is scenery: what a place looks like is not known.
 */
function shoreOf(box, { crowd, lines }, extent) {
  const middle = box.getCenter(new Vector3());
  const people = crowd.flatMap(({ corners }) => corners).map(([north, east]) => placed(north, east, 0));
  const places = people.length ? people : lines.map(({ start, end }) => placed(0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1]), 0));
  const mean = places.reduce((sum, one) => sum.add(one), new Vector3()).divideScalar(places.length || 1);
  const inland = places.length ? mean.sub(middle).setY(0) : new Vector3(1, 0, -0.45);
  if (inland.lengthSq() < 1) inland.set(1, 0, -0.45);
  inland.normalize();
  const along = places.map((one) => one.dot(inland));
  const corners = [box.min.x, box.max.x].flatMap((x) => [box.min.z, box.max.z].map((z) => new Vector3(x, 0, z).dot(inland)));
  const offset = places.length ? Math.min(...along) - 25 : Math.max(...corners) + 0.3 * extent;
  return new Vector3(inland.x, inland.z, offset);
}

/** Noise that repeats: a sum of octaves, its slopes, and another sum, one per channel. */
function noiseTexture() {
  let seed = 20140413;
  const random = () => {
    seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
    return seed / 4294967296;
  };
  const [one, other] = [octaves(random), octaves(random)];
  const at = (i, j) => one[(j & (TEXELS - 1)) * TEXELS + (i & (TEXELS - 1))];
  const bytes = new Uint8Array(4 * TEXELS * TEXELS);
  for (let j = 0; j < TEXELS; j += 1)
    for (let i = 0; i < TEXELS; i += 1) {
      const slopes = [at(i + 1, j) - at(i - 1, j), at(i, j + 1) - at(i, j - 1)];
      const values = [at(i, j), 0.5 + 4 * slopes[0], 0.5 + 4 * slopes[1], other[j * TEXELS + i]];
      bytes.set(values.map((value) => 255 * Math.min(Math.max(value, 0), 1)), 4 * (j * TEXELS + i));
    }
  const texture = new DataTexture(bytes, TEXELS, TEXELS);
  Object.assign(texture, { wrapS: RepeatWrapping, wrapT: RepeatWrapping, magFilter: LinearFilter });
  Object.assign(texture, { minFilter: LinearMipmapNearestFilter, generateMipmaps: true, needsUpdate: true });
  return texture;
}

/** Values from 0 to 1 of smoothly joined random numbers, at ever finer steps. */
function octaves(random) {
  const sum = new Float32Array(TEXELS * TEXELS);
  for (let octave = 0; octave < OCTAVES; octave += 1) {
    const cells = 8 << octave;
    const knots = Float32Array.from({ length: cells * cells }, random);
    const smooth = (share) => share * share * (3 - 2 * share);
    for (let j = 0; j < TEXELS; j += 1)
      for (let i = 0; i < TEXELS; i += 1) {
        const [u, v] = [(i * cells) / TEXELS, (j * cells) / TEXELS];
        const [left, low] = [Math.floor(u), Math.floor(v)];
        const knot = (a, b) => knots[((low + b) % cells) * cells + ((left + a) % cells)];
        const [s, t] = [smooth(u - left), smooth(v - low)];
        const rows = [0, 1].map((b) => knot(0, b) + s * (knot(1, b) - knot(0, b)));
        sum[j * TEXELS + i] += (rows[0] + t * (rows[1] - rows[0])) * 0.5 ** (octave + 1);
      }
  }
  return sum.map((value) => value / (1 - 0.5 ** OCTAVES));
}

/** A broad arrow on the ground, in the north-west of the course. */
function northArrow(box, extent) {
  const size = 0.05 * extent;
  const shape = new Shape();
  shape.moveTo(0, size);
  shape.lineTo(0.42 * size, -0.55 * size);
  shape.lineTo(0, -0.25 * size);
  shape.lineTo(-0.42 * size, -0.55 * size);
  shape.closePath();
  const arrow = new Mesh(new ShapeGeometry(shape), new MeshBasicMaterial({ depthWrite: false, transparent: true, opacity: 0.7 }));
  arrow.rotation.x = -Math.PI / 2;
  arrow.position.set(box.min.x - 0.1 * extent, 0, box.min.z - 0.1 * extent + size);
  arrow.renderOrder = -17;
  return arrow;
}

// Sky and ground give colours as a screen shows them also where they are drawn ahead: else few steps of dark ones would be left.
const COLOURS = ["zenith", "horizon", "cloud", "deep", "shallow", "sand", "grass", "grass-dry"];

const SKY = `
uniform sampler2D noise;
uniform vec3 sun, sunlight, zenith, horizon, cloud, shore;
uniform float water;

float power8(float x) {
  x *= x;
  x *= x;
  return x * x;
}

/** The sRGB curve by roots, which a processor has sooner than powers: within 0.2 of 255 steps above the darkest. */
vec4 onScreen(vec3 colour) {
  vec3 second = sqrt(colour);
  vec3 fourth = sqrt(second);
  return vec4(0.662002687 * second + 0.68412206 * fourth - 0.323583601 * sqrt(fourth) - 0.022541147 * colour, 1.0);
}

vec3 skyColour(vec3 direction) {
  float up = max(direction.y, 0.0);
  float low = (1.0 - up) * (1.0 - up);
  float near = power8(max(dot(direction, sun), 0.0));
  return mix(zenith, horizon, low * low) + sunlight * (0.1 * near + 0.22 * power8(near));
}`;

const SKY_VERTEX = `
varying vec3 towards;
void main() {
  towards = position;
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
}`;

const SKY_FRAGMENT = `${SKY}
varying vec3 towards;
void main() {
  vec3 direction = normalize(towards);
  vec3 colour = skyColour(direction);
  if (direction.y > 0.015) {
    vec2 overhead = direction.xz / (direction.y + 0.12);
    float heap = 0.62 * textureLod(noise, 0.035 * overhead, 0.0).a + 0.38 * textureLod(noise, 0.11 * overhead + 0.3, 0.0).r;
    float cover = smoothstep(0.52, 0.74, heap) * smoothstep(0.015, 0.16, direction.y);
    colour = mix(colour, cloud * (1.05 - 0.35 * smoothstep(0.6, 0.9, heap)), 0.8 * cover);
    colour += sunlight * smoothstep(0.99975, 0.9999, dot(direction, sun));
  }
  if (direction.y < 0.0) colour = mix(horizon, zenith, 0.25);
  if (direction.y < 0.075) {
    // Hills far off: all around land, else on the side of the shore.
    float turn = atan(direction.z, direction.x) / 6.2831853;
    float crest = textureLod(noise, vec2(2.0 * turn, 0.37), 1.0).r + 0.25 * textureLod(noise, vec2(7.0 * turn, 0.71), 1.0).a - 0.5;
    float side = smoothstep(-0.15, 0.5, dot(normalize(direction.xz), shore.xy));
    float height = max(crest, 0.0) * 0.085 * mix(1.0, side, water);
    float hill = 1.0 - smoothstep(height - 0.0012, height + 0.0004, direction.y);
    colour = mix(colour, mix(horizon, zenith, 0.45) * 0.82, hill * step(0.0005, height));
  }
  gl_FragColor = onScreen(colour);
}`;

const GROUND_VERTEX = `
varying vec3 place;
void main() {
  vec4 world = modelMatrix * vec4(position, 1.0);
  place = world.xyz;
  gl_Position = projectionMatrix * viewMatrix * world;
}`;

const GROUND_FRAGMENT = `${SKY}
uniform vec3 deep, shallow, sand, grass, grass_dry;
uniform float time, haze, grid, spacing;
varying vec3 place;

/** Lines that are as wide in the picture wherever they lie, and fade before they would be too dense. */
float lines(vec2 at, float apart) {
  vec2 cell = at / apart;
  vec2 wide = fwidth(cell);
  vec2 on = 1.0 - smoothstep(0.4 * wide, 1.3 * wide, abs(fract(cell - 0.5) - 0.5));
  return max(on.x, on.y) * (1.0 - smoothstep(0.08, 0.3, max(wide.x, wide.y)));
}

void main() {
  vec2 at = place.xz;
  float away = distance(place, cameraPosition);
  vec3 view = (cameraPosition - place) / away;
  float broad = texture2D(noise, at / 1900.0).r;
  float middle = texture2D(noise, at / 310.0 + 0.2).a;
  float inland = mix(1000.0, dot(at, shore.xy) - shore.z + 240.0 * (broad - 0.5) + 60.0 * (middle - 0.5), water);
  vec3 colour;
  if (inland < 4.0) {
    vec2 drift = time * vec2(0.9, 0.5);
    vec2 slope = 1.2 * (texture2D(noise, (at + 1.6 * drift) / 23.0).gb - 0.5);
    slope += 0.95 * (texture2D(noise, (at.yx - 2.6 * drift) / 130.0).gb - 0.5);
    if (away < 250.0) slope += 0.7 * (1.0 - away / 250.0) * (texture2D(noise, (at + drift.yx) / 5.3).gb - 0.5);
    vec3 normal = normalize(vec3(-0.45 * slope.x, 1.0, -0.45 * slope.y));
    vec3 mirrored = reflect(-view, normal);
    mirrored.y = abs(mirrored.y);
    float grazing = 1.0 - max(dot(normal, view), 0.0);
    float mirror = 0.03 + 0.72 * grazing * grazing * grazing * grazing * grazing;
    float bed = smoothstep(-140.0, 4.0, inland) + 0.25 * (middle - 0.5) + 0.2 * (broad - 0.5);
    colour = mix(mix(deep, shallow, clamp(bed, 0.0, 1.0)), skyColour(mirrored), mirror);
    float glint = power8(max(dot(mirrored, sun), 0.0));
    colour += sunlight * (0.3 * glint * glint * glint);
    colour = mix(colour, cloud, 0.5 * smoothstep(-7.0, 2.0, inland + 30.0 * slope.x));
  } else {
    float blades = texture2D(noise, at / 11.0).r;
    float patches = texture2D(noise, at / 120.0).r;
    vec3 meadow = mix(grass, grass_dry, smoothstep(0.38, 0.66, 0.55 * broad + 0.45 * middle));
    meadow *= 0.8 + 0.22 * smoothstep(0.3, 0.7, patches) + 0.36 * (blades - 0.5);
    colour = mix(sand * (0.9 + 0.2 * blades), meadow, smoothstep(9.0, 26.0, inland + 12.0 * (patches - 0.5)));
  }
  float mesh = grid == 0.0 ? 0.0 : max(0.05 * lines(at, spacing), 0.12 * lines(at, 5.0 * spacing));
  colour = mix(colour, cloud, mesh);
  float air = haze * away * away / (away * away + 2.2e8);
  gl_FragColor = onScreen(mix(colour, mix(horizon, zenith, 0.25), air));
}`;

const WHOLE_VERTEX = `
varying vec2 at;
void main() {
  at = uv;
  gl_Position = vec4(position.xy, 0.0, 1.0);
}`;

const DRAWN_FRAGMENT = `
uniform sampler2D drawn;
varying vec2 at;
void main() { gl_FragColor = texture2D(drawn, at); }`;

const DARK = 0.34;
const NUMBER = 254; // in the stencil, of all shadows

/** A material that paints no spot twice, however its triangles overlap. */
export function once(material, number) {
  const stencil = { stencilWrite: true, stencilRef: number, stencilFunc: NotEqualStencilFunc };
  return Object.assign(material, stencil, { stencilZPass: ReplaceStencilOp });
}

/** The shadow of an object with all its parts; `follow()` moves it after the object has been moved. */
export function shadowOf(object, sun) {
  const look = { color: "#04121c", transparent: true, opacity: DARK, depthWrite: false };
  const material = once(new MeshBasicMaterial(look), NUMBER);
  const group = new Group();
  const flat = new Matrix4().set(1, -sun.x / sun.y, 0, 0, 0, 0, 0, 0, 0, -sun.z / sun.y, 1, 0, 0, 0, 0, 1);
  const pairs = [];
  object.traverse((part) => {
    if (!part.isMesh || part.material.opacity < 0.3) return;
    const mesh = new Mesh(part.geometry, material);
    Object.assign(mesh, { matrixAutoUpdate: false, frustumCulled: false, renderOrder: -6 });
    pairs.push([mesh, part]);
    group.add(mesh);
  });
  group.follow = () => {
    object.updateMatrixWorld(true);
    for (const [mesh, part] of pairs) mesh.matrix.multiplyMatrices(flat, part.matrixWorld);
  };
  group.follow();
  return group;
}
