// Positions of the mechanism's points at a sample, and the solids drawn round them. Metres.

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

// Triangles of many solids in one mesh; a rebuild with the same calls keeps the same triangles.
class Solids {
  constructor() { this.x = []; this.y = []; this.z = []; this.i = []; this.j = []; this.k = []; this.colours = []; }

  vertex(p) { this.x.push(1e3 * p[0]); this.y.push(1e3 * p[1]); this.z.push(1e3 * p[2]); return this.x.length - 1; }

  face(a, b, c, colour) { this.i.push(a); this.j.push(b); this.k.push(c); this.colours.push(colour); }

  ring(centre, axis, radius, sides) {
    const side = unit(cross(axis, Math.abs(axis[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0]));
    const other = cross(axis, side);
    return Array.from({ length: sides }, (_, n) => {
      const angle = 2 * Math.PI * n / sides;
      return this.vertex(plus(plus(centre, side, radius * Math.cos(angle)), other, radius * Math.sin(angle)));
    });
  }

  // A cone from radius a to radius b; equal ones make a cylinder.
  cone(from, to, a, b, colour, sides = 12) {
    const axis = unit(minus(to, from));
    const low = this.ring(from, axis, a, sides), high = this.ring(to, axis, b, sides);
    const bottom = this.vertex(from), top = this.vertex(to);
    for (let n = 0; n < sides; n++) {
      const m = (n + 1) % sides;
      this.face(low[n], low[m], high[m], colour);
      this.face(low[n], high[m], high[n], colour);
      this.face(bottom, low[m], low[n], colour);
      this.face(top, high[n], high[m], colour);
    }
  }

  sphere(centre, radius, colour, sides = 14) {
    const rows = sides / 2;
    const start = this.x.length;
    for (let r = 0; r <= rows; r++) {
      const polar = Math.PI * r / rows;
      for (let n = 0; n < sides; n++) {
        const angle = 2 * Math.PI * n / sides, flat = Math.sin(polar) * radius;
        this.vertex(plus(centre, [flat * Math.cos(angle), flat * Math.sin(angle), radius * Math.cos(polar)]));
      }
    }
    for (let r = 0; r < rows; r++) {
      for (let n = 0; n < sides; n++) {
        const a = start + r * sides + n, b = start + r * sides + (n + 1) % sides;
        this.face(a, a + sides, b + sides, colour);
        this.face(a, b + sides, b, colour);
      }
    }
  }

  // A band along points, flat towards the platform's middle; its shape is that of scene/muscles.py.
  band(line, width, colour) {
    const { belly, flat, sides } = payload.machine.band;
    const steps = line.slice(1).map((p, n) => length(minus(p, line[n]))), whole = steps.reduce((a, b) => a + b) || 1;
    const along = [0]; for (const step of steps) along.push(along.at(-1) + step / whole);
    const chord = unit(minus(line.at(-1), line[0]));
    const out = minus(plus(line[0], minus(line.at(-1), line[0]), 0.5), [...origin]);
    const thin = unit(plus(out, chord, -dot(out, chord))), wide = cross(thin, chord);
    const at = [...belly.map(([t]) => t), ...along.slice(1, -1)].sort((a, b) => a - b);
    const rings = at.map((t) => {
      let n = 1; while (n < along.length - 1 && along[n] < t) n++;
      const middle = plus(line[n - 1], minus(line[n], line[n - 1]), (t - along[n - 1]) / (along[n] - along[n - 1] || 1));
      let k = 1; while (k < belly.length - 1 && belly[k][0] < t) k++;
      const [[t0, a], [t1, b]] = [belly[k - 1], belly[k]], half = 0.5 * width * (a + (b - a) * (t - t0) / (t1 - t0));
      return Array.from({ length: sides }, (_, s) => {
        const angle = 2 * Math.PI * s / sides;
        return this.vertex(plus(plus(middle, wide, half * Math.cos(angle)), thin, half * flat * Math.sin(angle)));
      });
    });
    for (let r = 0; r + 1 < rings.length; r++) {
      for (let s = 0; s < sides; s++) {
        const m = (s + 1) % sides;
        this.face(rings[r][s], rings[r][m], rings[r + 1][m], colour);
        this.face(rings[r][s], rings[r + 1][m], rings[r + 1][s], colour);
      }
    }
    for (let s = 1; s + 1 < sides; s++) {
      this.face(rings[0][0], rings[0][s + 1], rings[0][s], colour);
      this.face(rings.at(-1)[0], rings.at(-1)[s], rings.at(-1)[s + 1], colour);
    }
  }

  arrow(from, vector, radius, colour) {
    const size = length(vector), tip = plus(from, vector);
    const neck = plus(tip, unit(vector), -Math.min(5 * radius, 0.5 * size));
    const fit = Math.min(1, size / (5 * radius));  // short arrows are thin ones
    this.cone(from, neck, radius * fit, radius * fit, colour, 10);
    this.cone(neck, tip, 2.4 * radius * fit, 0, colour, 14);
  }
}
