// The mechanism in 3D, drawn with plotly and moved with the clock.

const stageNode = document.getElementById("stage");
const drawn = payload.machine;
const CAMERAS = drawn.views;
const HALF_FIELD = Math.tan(Math.PI / 8);  // of plotly's perspective
const FILL = 0.86;  // of the canvas
const FLAT_DISTANCE = 3;
// Plotly takes the light's place through the projection, and the flat one styles the other way.
const LIGHT = { false: { x: 2000, y: -3000, z: 6000 }, true: { x: -2000, y: 3000, z: -6000 } };

// Scene units: the middle of the box is the origin, its longest side is 1.
const sides = drawn.range.map(([low, high]) => high - low);
const longest = Math.max(...sides);
const middle = drawn.range.map(([low, high]) => (low + high) / 2);
const xyz = (v) => ({ x: v[0], y: v[1], z: v[2] });

// Camera and scale with which a view shows everything, as large as it fits.
function fitted(name) {
  const { from, up, flat } = CAMERAS[name];
  const aspect = stageNode.clientWidth / Math.max(stageNode.clientHeight, 1);
  const away = unit(from), right = unit(cross(up, from)), above = cross(away, right);
  const points = drawn.extent.map((p) => minus(p, middle).map((v) => v / longest));
  let centre = [0, 0, 0], scale = 1, distance = FLAT_DISTANCE;
  // Perspective moves the middle a little with the distance.
  for (let pass = 0; pass < 4; pass++) {
    const seen = points.map((p) => {
      const q = minus(p, centre), depth = dot(q, away);
      const near = flat ? 1 : Math.max(distance - depth, 0.1);
      return { x: dot(q, right), y: dot(q, above), depth, near };
    });
    const span = (axis) => {
      const angles = seen.map((p) => p[axis] / p.near);
      const low = Math.min(...angles), high = Math.max(...angles), back = flat ? 1 : distance;
      return [back * (low + high) / 2, (high - low) / 2];
    };
    const [[x, wide], [y, high]] = [span("x"), span("y")];
    centre = plus(plus(centre, right, x), above, y);
    if (flat) scale = FILL * Math.min(aspect / wide, 1 / high);
    else distance = Math.max(...seen.map((p) =>
      p.depth + Math.max(Math.abs(p.x - x) / aspect, Math.abs(p.y - y)) / (HALF_FIELD * FILL)));
  }
  centre = centre.map((v) => v * scale);
  return {
    camera: { eye: xyz(plus(centre, away, distance)), center: xyz(centre), up: xyz(up), projection: { type: flat ? "orthographic" : "perspective" } },
    aspectratio: xyz(sides.map((side) => scale * side / longest)),
  };
}

let view = "Oblique", flat = CAMERAS.Oblique.flat;
const NEEDS = { surfaces: drawn.surfaces, forces: drawn.arrows, markers: drawn.markers };  // of layers that may be empty
const layersShown = Object.fromEntries(
  ["platform", "chains", "surfaces", "forces", "traces", "markers", "labels", "axes"]
    .filter((layer) => !(layer in NEEDS) || NEEDS[layer].length)
    .map((layer) => [layer, true]));
const FORCE = { contact: "--cursor", load: "--ink" };

// Solids at a sample; grey and without forces where they stand for one that has no result.
function bodies(index, grey) {
  const tinted = (tint) => (grey ? role("neutral") : tint);
  const chains = new Solids(), joints = new Solids(), balls = new Solids(), forces = new Solids();
  for (const rod of drawn.rods) {
    const tint = rod.colour === null ? role("neutral") : colour(rod.colour);
    chains.cone(position(rod.from, index), position(rod.to, index), rod.radius, rod.radius, tinted(tint));
  }
  for (const joint of drawn.joints) joints.sphere(position(joint, index), joint.radius, role("neutral"), 12);
  for (const ball of drawn.balls) balls.sphere(position(ball.at, index), ball.radius, tinted(role("ball")), 18);
  for (const arrow of drawn.arrows) {
    const perNewton = drawn.scales[arrow.kind]?.metresPerNewton ?? 0;
    const vector = arrow.columns.map((c) => grey ? 0 : column(c)[index] * perNewton);
    // At the ball's skin, or a small force would hide in it.
    const near = plus(position(arrow.at, index), unit(vector), arrow.into ? -arrow.gap : arrow.gap);
    forces.arrow(arrow.into ? minus(near, vector) : near, vector, 0.026 * drawn.size, css(FORCE[arrow.kind]));
  }
  const platform = new Solids(), { vertices, faces, teeth } = drawn.body;
  for (const v of vertices) platform.vertex(onPlatform(v));
  faces.forEach(([a, b, c], n) =>
    platform.face(a, b, c, tinted(role(teeth === null ? "platform" : n < teeth ? "bone" : "teeth"))));
  for (const muscle of drawn.muscles) {
    chains.band(muscle.points.map((p) => position(p, index)), muscle.width, tinted(activationColour(muscle, index)));
  }
  return { platform, chains, joints, balls, forces };
}

// From rest to the top of the panel's scale, by the colours of the theme; the last one beyond 1.
function activationColour({ column: number, scale }, index) {
  const stops = drawn.band.colours[themeName() === "dark" ? 1 : 0], last = stops.length - 2;
  const whole = number === null ? 0 : Math.abs(column(number)[index] * scale) || 0;
  if (whole > 1 + 1e-6) return stops[last + 1];
  const value = Math.min(whole / drawn.band.top, 1);
  const k = Math.min(Math.floor(value * last), last - 1), part = value * last - k;
  const channel = (text, n) => parseInt(text.slice(n, n + 2), 16);
  return `rgb(${[1, 3, 5].map((n) => Math.round(channel(stops[k], n) + part * (channel(stops[k + 1], n) - channel(stops[k], n))))})`;
}

const SOLID_LAYERS = { platform: "platform", chains: "chains", joints: "chains", balls: "platform", forces: "forces" };
const OPACITY = drawn.body.teeth === null ? 0.45 : 1;

function solidTrace(name, solids) {
  return {
    type: "mesh3d", name, x: solids.x, y: solids.y, z: solids.z, i: solids.i, j: solids.j, k: solids.k,
    facecolor: solids.colours, hoverinfo: "skip", flatshading: name === "platform",
    opacity: name === "platform" ? OPACITY : 1,
    lighting: { ambient: 0.62, diffuse: 0.75, specular: 0.12, roughness: 0.7, fresnel: 0.05 },
    lightposition: LIGHT[flat],
  };
}

function surfaceTraces() {
  const solids = new Solids();
  for (const surface of drawn.surfaces) {
    const start = solids.x.length;
    for (const v of surface.vertices) solids.vertex(v);
    for (const [a, b, c] of surface.faces) solids.face(start + a, start + b, start + c, role("surface"));
  }
  const border = { x: [], y: [], z: [] };
  for (const surface of drawn.surfaces.filter((s) => s.bounded)) {
    for (const [a, b] of surface.outline) {
      for (const [axis, n] of [["x", 0], ["y", 1], ["z", 2]]) border[axis].push(1e3 * a[n], 1e3 * b[n], null);
    }
  }
  return [
    { ...solidTrace("surfaces", solids), opacity: 0.55 },
    { type: "scatter3d", mode: "lines", name: "bounds", ...border, hoverinfo: "skip", line: { width: 4, color: css("--ink") } },
  ];
}

function pathTraces() {
  return drawn.traces.map((trace) => {
    const path = { x: [], y: [], z: [] };
    const step = Math.max(Math.floor(samples / 1500), 1);
    for (let i = 0; i < samples; i += step) {
      setPose(i);
      const p = onPlatform(trace.at);
      path.x.push(1e3 * p[0]); path.y.push(1e3 * p[1]); path.z.push(1e3 * p[2]);
    }
    return { type: "scatter3d", mode: "lines", name: `path of ${trace.name}`, ...path, hoverinfo: "skip", line: { width: 3, color: css("--cursor") } };
  });
}

// Names at one place of the picture stand beside each other, where the first is.
function labelTexts(named, places) {
  const texts = named.map((item) => plain(item.name));
  if (!view) return texts;
  const { from, up } = CAMERAS[view], right = unit(cross(up, from)), above = cross(unit(from), right);
  const seen = places.map((p) => [dot(p, right) / 1e3 / longest, dot(p, above) / 1e3 / longest]);
  seen.forEach(([x, y], n) => {
    const first = seen.findIndex(([a, b]) => Math.abs(a - x) < LABEL_WIDE && Math.abs(b - y) < LABEL_HIGH);
    if (first === n) return;
    texts[first] = `${texts[first].trimEnd()}, ${texts[n]}`;
    texts[n] = "";
  });
  return texts;
}

const LABEL_WIDE = 0.12, LABEL_HIGH = 0.03;  // of the longest side, about a name's size

function labelTrace(index) {
  const named = [...drawn.landmarks, ...drawn.balls];
  const places = named.map((item) => position(item.at, index).map((v) => 1e3 * v));
  return {
    type: "scatter3d", mode: "markers+text", name: "landmarks",
    x: places.map((p) => p[0]), y: places.map((p) => p[1]), z: places.map((p) => p[2]),
    text: labelTexts(named, places),
    textposition: named.map((_, n) => n < drawn.landmarks.length ? "top right" : "bottom center"),
    textfont: { size: 11, color: css("--ink") }, hoverinfo: "skip",
    marker: { size: named.map((_, n) => n < drawn.landmarks.length ? 4 : 0.1), color: css("--ink") },
  };
}

// Measured markers: a sign and a colour for each body, nothing where one was not seen.
const MARKERS = drawn.markerStyles;

function markerTrace(index) {
  const places = drawn.markers.map((marker) => marker.columns.map((c) => {
    const value = 1e3 * column(c)[index];
    return Number.isFinite(value) ? value : null;
  }));
  const styles = drawn.markers.map((marker) => MARKERS[marker.body]);
  return {
    type: "scatter3d", mode: "markers", name: "markers", hoverinfo: "text", text: drawn.markers.map((marker) => plain(marker.name)),
    x: places.map((p) => p[0]), y: places.map((p) => p[1]), z: places.map((p) => p[2]),
    marker: { size: 5, symbol: styles.map((one) => one.symbol), color: styles.map((one) => colour(one.colour)), line: { width: 0 } },
  };
}

function fillMarkerLegend() {
  const legend = document.getElementById("marker-legend");
  const bodies = Object.keys(MARKERS).filter((body) => drawn.markers.some((marker) => marker.body === body));
  legend.hidden = !bodies.length;
  legend.replaceChildren(...bodies.flatMap((body, n) => {
    const { sign, text, colour: number } = MARKERS[body];
    return [n ? ", " : "", element("span", { style: `color:${colour(number)}` }, sign), ` ${text}`];
  }));
}

// Plotly reads a little HTML in labels, and styles texts up in plain objects, where "constructor" is
// found before it was put there; a name is only text.
const plain = (text) => {
  const written = text.replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
  return written in {} ? `${written} ` : written;
};

// The directions of {S}, with arms of a round length: cleaner than ticks in space.
function triadTraces() {
  const { origin: corner, arm } = drawn.triad;
  const solids = new Solids();
  const tips = [0, 1, 2].map((n) => [0, 1, 2].map((i) => (i === n ? arm : 0)));
  for (const tip of tips) solids.arrow(corner, tip, 0.02 * drawn.size, css("--soft"));
  const places = tips.map((tip) => plus(corner, tip, 1.22).map((v) => 1e3 * v));
  return [
    solidTrace("axes", solids),
    {
      type: "scatter3d", mode: "text", name: "axes", x: places.map((p) => p[0]), y: places.map((p) => p[1]), z: places.map((p) => p[2]),
      text: ["X", "Y", "Z"], textfont: { size: 12, color: css("--soft") }, hoverinfo: "skip",
    },
  ];
}

function stageLayout() {
  const axis = (n) => ({ range: drawn.range[n].map((v) => 1e3 * v), visible: false, showspikes: false });
  return {
    ...sizeOf(stageNode), margin: { l: 0, r: 0, t: 0, b: 0 }, showlegend: false, paper_bgcolor: "rgba(0,0,0,0)", hovermode: false,
    uirevision: "stage",
    scene: { aspectmode: "manual", xaxis: axis(0), yaxis: axis(1), zaxis: axis(2), dragmode: "orbit" },
  };
}

// Traces by layer, in the order plotly holds them: moving solids, labels, then what stays.
let layerOf = [];

function stageTraces(index, grey) {
  const solids = bodies(index, grey);
  const traces = Object.entries(solids).map(([name, s]) => ({ ...solidTrace(name, s), layer: SOLID_LAYERS[name] }));
  traces.push({ ...labelTrace(index), layer: "labels" });
  if (drawn.markers.length) traces.push({ ...markerTrace(index), layer: "markers" });
  traces.push(...surfaceTraces().map((t) => ({ ...t, layer: "surfaces" })));
  traces.push(...pathTraces().map((t) => ({ ...t, layer: "traces" })));
  traces.push(...triadTraces().map((t) => ({ ...t, layer: "axes" })));
  setPose(index);
  layerOf = traces.map((t) => t.layer);
  for (const trace of traces) {
    trace.visible = layersShown[trace.layer] ?? false;
    delete trace.layer;
  }
  return traces;
}

let stageReady = false, stageBusy = false, stageShows = "";

// What the picture shows at a sample: it, or grey the nearest one that has a result.
const wantedAt = (index) => ({ sample: index, drawn: goodSample[index], grey: isFailed(index) });
const keyOf = ({ drawn, grey }) => `${drawn} ${grey}`;

async function drawStage() {
  stageBusy = true;
  fillMarkerLegend();
  fillMuscleLegend();
  const wanted = wantedAt(clock.index);
  setPose(wanted.drawn);
  const layout = stageLayout();
  const before = stageNode.layout?.scene;
  Object.assign(layout.scene, before ? { camera: before.camera, aspectratio: before.aspectratio } : fitted(view));
  await Plotly.react(stageNode, stageTraces(wanted.drawn, wanted.grey), layout, { displayModeBar: false, responsive: false });
  if (!stageReady) stageNode.on("plotly_relayout", turnedByHand);
  stageReady = true;
  stageBusy = false;
  shown3d(wanted);
  moveStage(clock.index);
}

function shown3d(wanted) {
  stageShows = keyOf(wanted);
  stageNode.dataset.sample = wanted.sample;
  stageNode.dataset.drawn = wanted.drawn;
  stageNode.dataset.grey = wanted.grey;
}

const MOVING = drawn.markers.length ? 7 : 6;  // platform, chains, joints, balls, forces, labels, markers
const CHAINS = 1, LABELS = 5;

// Names after the picture has turned: some may overlap now.
function relabel() {
  if (!stageReady) return;
  const wanted = wantedAt(clock.index);
  setPose(wanted.drawn);
  const { text } = labelTrace(wanted.drawn);
  if (String(text) !== String(stageNode.data[LABELS].text)) Plotly.restyle(stageNode, { text: [text] }, [LABELS]);
}

// At most one update is under way; the newest time wins.
async function moveStage(index) {
  showAlerts(index);
  if (!stageReady || stageBusy) return;
  if (keyOf(wantedAt(index)) === stageShows) return shown3d(wantedAt(index));
  stageBusy = true;
  while (keyOf(wantedAt(clock.index)) !== stageShows && stageReady) {
    const wanted = wantedAt(clock.index);
    setPose(wanted.drawn);
    const solids = Object.values(bodies(wanted.drawn, wanted.grey));
    const parts = [...solids, labelTrace(wanted.drawn)];
    if (drawn.markers.length) parts.push(markerTrace(wanted.drawn));
    if (stageShows.endsWith("true") !== wanted.grey) {
      await Plotly.restyle(stageNode, { facecolor: solids.map((s) => s.colours) }, [...solids.keys()]);
    }
    const moved = { x: parts.map((p) => p.x), y: parts.map((p) => p.y), z: parts.map((p) => p.z) };
    if (drawn.muscles.length) moved.facecolor = parts.map((p, n) => (n === CHAINS ? p.colours : undefined));
    await Plotly.restyle(stageNode, moved, [...Array(MOVING).keys()]);
    shown3d(wanted);
  }
  relabel();
  stageBusy = false;
}

// What is wrong at this sample.
function showAlerts(index) {
  const active = payload.alerts.filter((alert) => column(alert.column)[index] === 1);
  const message = document.getElementById("stage-message");
  message.hidden = !active.length;
  if (!active.length) return;
  const when = (i) => `t = ${time[i].toFixed(timeDecimals)} s`;
  if (active.some((alert) => alert.failed)) {
    const why = failureAt(time[index]) || active.find((alert) => alert.failed).text;
    message.textContent = `${when(index)}: no result, ${why}. Grey: the mechanism at ${when(goodSample[index])}, without forces`;
  } else {
    message.textContent = `${when(index)}: ${active.map((a) => a.text).join("; ")}`;
  }
}

function setCamera(name) {
  view = name;
  for (const button of document.querySelectorAll("#cameras button")) {
    button.setAttribute("aria-pressed", String(button.textContent === name));
  }
  flat = CAMERAS[name].flat;
  if (!stageReady) return;
  const solids = stageNode.data.flatMap((trace, n) => (trace.type === "mesh3d" ? [n] : []));
  Plotly.update(stageNode, { lightposition: LIGHT[flat] }, change(name), solids).then(relabel);
}

function change(name) {
  const { camera, aspectratio } = fitted(name);
  return {
    "scene.camera.eye": camera.eye, "scene.camera.up": camera.up, "scene.camera.center": camera.center,
    "scene.camera.projection.type": camera.projection.type, "scene.aspectratio": aspectratio,
  };
}

// The canvas has another size; a preset is fitted to it again.
function resizeStage() {
  if (stageReady) Plotly.relayout(stageNode, { ...sizeOf(stageNode), ...(view ? change(view) : {}) });
}

// A view turned by hand is no preset any more.
function turnedByHand(event) {
  if (!event["scene.camera"]) return;
  view = null;
  relabel();
  for (const button of document.querySelectorAll("#cameras button")) button.setAttribute("aria-pressed", "false");
}

function setLayer(layer, on) {
  layersShown[layer] = on;
  const numbers = layerOf.flatMap((l, n) => (l === layer ? [n] : []));
  if (numbers.length) Plotly.restyle(stageNode, { visible: on }, numbers);
}

const short = (value, digits) => Number(value.toPrecision(digits));
const lengthText = (metres) => (metres < 1 ? `${short(1e3 * metres, 3)} mm` : `${short(metres, 3)} m`);

function fillMuscleLegend() {
  const legend = document.getElementById("muscle-legend"), stops = drawn.band.colours[themeName() === "dark" ? 1 : 0];
  legend.hidden = !drawn.muscles.some((muscle) => muscle.column !== null);
  const ramp = `linear-gradient(90deg, ${stops.slice(0, -1).join(", ")})`;
  legend.replaceChildren("Muscles by activation: 0 ", element("span", { class: "ramp", style: `background:${ramp}` }), ` ${drawn.band.top}`,
    ...(drawn.band.top < 1 ? [] : ["; beyond: ", element("span", { style: `color:${stops.at(-1)}` }, "■")]), ". Widths by the root of the greatest force.");
}

function stageNote() {
  const notes = [];
  const { samples: kept, total } = payload.columns;
  if (kept < total) {
    const span = short((time[samples - 1] - time[0]) / (envelope.edges.length - 1), 2);
    notes.push(`The page has ${kept} of ${total} samples; plots show the smallest and largest value of every ${span} s.`);
  }
  if (payload.failures.length) notes.push("Grey in the plots: no result.");
  notes.push(`Arms of the axes: ${lengthText(drawn.triad.arm)}.`);
  const arrows = Object.entries(drawn.scales).map(([kind, { metresPerNewton, largest }]) =>
    `${{ load: "load", contact: say("contact forces") }[kind]} ${lengthText(drawn.triad.arm)} for ${short(drawn.triad.arm / metresPerNewton, 2)} N, at most ${short(largest, 4)} N`);
  if (arrows.length) notes.push(`Arrows: ${arrows.join("; ")}.`);
  if (drawn.undrawn.length) notes.push(`Not drawn, because the surface's equation is not in the solution: ${drawn.undrawn.join(", ")}.`);
  return notes.join(" ");
}
