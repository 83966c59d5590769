// Positions of the mechanism's points at a sample, and the solids that ride on them. Metres.

const rotation = new Float64Array(9);
const origin = new Float64Array(3);

// R = Rx(alpha) Ry(beta) Rz(gamma), row by row.
function setPose(index) {
  const [x, y, z, alpha, beta, gamma] = payload.machine.pose.map((c) => column(c)[index]);
  const ca = Math.cos(alpha), sa = Math.sin(alpha), cb = Math.cos(beta), sb = Math.sin(beta);
  const cg = Math.cos(gamma), sg = Math.sin(gamma);
  origin.set([x, y, z]);
  rotation.set([
    cb * cg, -cb * sg, sb,
    ca * sg + sa * sb * cg, ca * cg - sa * sb * sg, -sa * cb,
    sa * sg - ca * sb * cg, sa * cg + ca * sb * sg, ca * cb,
  ]);
}

function onPlatform(p) {
  return [0, 1, 2].map((i) =>
    origin[i] + rotation[3 * i] * p[0] + rotation[3 * i + 1] * p[1] + rotation[3 * i + 2] * p[2]);
}

function position(point, index) {
  if (point.fixed) return point.fixed;
  if (point.platform) return onPlatform(point.platform);
  return point.columns.map((c) => column(c)[index]);
}

const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const plus = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const length = (a) => Math.hypot(a[0], a[1], a[2]);
const cross = (a, b) =>
  [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => { const l = length(a) || 1; return [a[0] / l, a[1] / l, a[2] / l]; };

// As `scene/solids.py`: z of a vertex is along the line, 1 a point; y is away from a point inside.
function swept(line, vertices, inside, thick = 1) {
  const chord = unit(minus(line.at(-1), line[0]));
  const out = minus(plus(line[0], minus(line.at(-1), line[0]), 0.5), inside);
  let thin = plus(out, chord, -dot(out, chord));
  if (!(length(thin) > 1e-9)) thin = cross(chord, Math.abs(chord[2]) < 0.6 ? [0, 0, 1] : [1, 0, 0]);
  thin = unit(thin);
  const wide = cross(thin, chord);
  return vertices.map(([x, y, z]) => {
    const k = Math.min(Math.floor(z), line.length - 2);
    return plus(plus(plus(line[k], minus(line[k + 1], line[k]), z - k), wide, thick * x), thin, thick * y);
  });
}

// The vertices of a solid in {S} at a sample.
function placed({ motion, points, vertices }, index) {
  if (motion === "fixed") return vertices;
  if (motion === "platform") return vertices.map(onPlatform);
  const line = points.map((point) => position(point, index));
  return motion === "point" ? vertices.map((v) => plus(line[0], v)) : swept(line, vertices, origin);
}

// Triangles of many solids in one mesh; a rebuild with the same calls keeps the same triangles.
class Mesh {
  constructor() { this.x = []; this.y = []; this.z = []; this.i = []; this.j = []; this.k = []; this.colours = []; }

  add(vertices, faces, colour) {
    const start = this.x.length;
    for (const v of vertices) { this.x.push(1e3 * v[0]); this.y.push(1e3 * v[1]); this.z.push(1e3 * v[2]); }
    for (const [a, b, c] of faces) { this.i.push(start + a); this.j.push(start + b); this.k.push(start + c); this.colours.push(colour); }
  }

  arrow(from, vector, colour) {
    const { pieces, radius, head, headPart } = payload.machine.arrow, size = length(vector);
    const neck = plus(plus(from, vector), unit(vector), -Math.min(head * radius, headPart * size));
    const thick = radius * Math.min(1, size / (head * radius));  // short arrows are thin ones
    const lines = [[from, neck], [neck, plus(from, vector)]];
    pieces.forEach((piece, n) => this.add(swept(lines[n], piece.vertices, from, thick), piece.faces, colour));
  }
}
