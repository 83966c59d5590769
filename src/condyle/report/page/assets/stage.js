// The mechanism in 3D, drawn with plotly and moved with the clock.

const stageNode = document.getElementById("stage");
const drawn = payload.machine;
// away: the axis along which a view looks, whose ticks would stand on one spot.
const CAMERAS = {
  Front: { eye: { x: 1.9, y: 0, z: 0 }, up: { x: 0, y: 0, z: 1 }, away: "x" },
  Side: { eye: { x: 0, y: -2.3, z: 0 }, up: { x: 0, y: 0, z: 1 }, away: "y" },
  Top: { eye: { x: 0, y: 0, z: 2.1 }, up: { x: 1, y: 0, z: 0 }, away: "z" },
  Oblique: { eye: { x: 1.15, y: -1.15, z: 0.6 }, up: { x: 0, y: 0, z: 1 }, away: null },
};
// Boxes far from a cube need a wider view.
const distance = (() => {
  const sides = drawn.range.map(([low, high]) => high - low);
  return Math.hypot(...sides) / Math.cbrt(sides[0] * sides[1] * sides[2]) / 1.83;
})();
const eyeOf = (name) => Object.fromEntries(Object.entries(CAMERAS[name].eye).map(([axis, v]) => [axis, v * distance]));

let view = "Oblique";
const layersShown = Object.fromEntries(
  ["platform", "chains", "surfaces", "forces", "traces", "labels"]
    .filter((layer) => (layer !== "surfaces" || drawn.surfaces.length) && (layer !== "forces" || drawn.arrows.length))
    .map((layer) => [layer, true]));
const NEUTRAL = { light: "#7d8894", dark: "#8d98a5" };
const PLATFORM = { light: "#c9d3de", dark: "#5b6877" };
const SURFACE = { light: "#e5b567", dark: "#b98a3c" };
const FORCE = { contact: 4, load: 5 };  // colours of the palette that chains seldom reach

const rodRadius = 0.022 * drawn.size;
const lastGood = { index: 0 };

function bodies(index) {
  const theme = themeName();
  const chains = new Solids(), joints = new Solids(), balls = new Solids(), forces = new Solids();
  for (const rod of drawn.rods) {
    const tint = rod.colour === null ? NEUTRAL[theme] : colour(rod.colour);
    const radius = rodRadius * rod.thickness;
    chains.cone(position(rod.from, index), position(rod.to, index), radius, radius, tint);
  }
  for (const joint of drawn.joints) joints.sphere(position(joint, index), 1.9 * rodRadius, NEUTRAL[theme], 12);
  for (const ball of drawn.balls) balls.sphere(position(ball.at, index), ball.radius, css("--cursor"), 18);
  for (const arrow of drawn.arrows) {
    const vector = arrow.columns.map((c) => column(c)[index] * drawn.metresPerNewton);
    // From the ball's skin, or a small force would hide in it.
    const from = plus(position(arrow.at, index), unit(vector), arrow.from);
    forces.arrow(from, vector, 0.026 * drawn.size, colour(FORCE[arrow.kind]));
  }
  const platform = new Solids();
  for (const v of drawn.hull.vertices) platform.vertex(onPlatform(v));
  for (const [a, b, c] of drawn.hull.faces) platform.face(a, b, c, PLATFORM[theme]);
  return { platform, chains, joints, balls, forces };
}

const SOLID_LAYERS = { platform: "platform", chains: "chains", joints: "chains", balls: "platform", forces: "forces" };

function solidTrace(name, solids) {
  return {
    type: "mesh3d", name, x: solids.x, y: solids.y, z: solids.z, i: solids.i, j: solids.j, k: solids.k,
    facecolor: solids.colours, hoverinfo: "skip", flatshading: name === "platform",
    opacity: name === "platform" ? 0.45 : 1,
    lighting: { ambient: 0.62, diffuse: 0.75, specular: 0.12, roughness: 0.7, fresnel: 0.05 },
    lightposition: { x: 2000, y: -3000, z: 6000 },
  };
}

function surfaceTraces() {
  const theme = themeName();
  const solids = new Solids();
  for (const surface of drawn.surfaces) {
    const start = solids.x.length;
    for (const v of surface.vertices) solids.vertex(v);
    for (const [a, b, c] of surface.faces) solids.face(start + a, start + b, start + c, SURFACE[theme]);
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

function labelTrace(index) {
  const named = [...drawn.landmarks, ...drawn.balls];
  const places = named.map((item) => position(item.at, index).map((v) => 1e3 * v));
  return {
    type: "scatter3d", mode: "markers+text", name: "landmarks",
    x: places.map((p) => p[0]), y: places.map((p) => p[1]), z: places.map((p) => p[2]),
    text: named.map((item) => plain(item.name)), textposition: "top center",
    textfont: { size: 11, color: css("--ink") }, hoverinfo: "skip",
    marker: { size: named.map((_, n) => n < drawn.landmarks.length ? 4 : 0.1), color: css("--ink") },
  };
}

// Plotly reads a little HTML in labels; a name is only text.
const plain = (text) => text.replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");

function stageLayout() {
  const axis = (name, n) => ({
    title: { text: name, font: { size: 12 } }, range: drawn.range[n].map((v) => 1e3 * v),
    tickfont: { size: 10 }, color: css("--soft"), gridcolor: css("--line"), zerolinecolor: css("--line"),
    visible: CAMERAS[view]?.away !== name.toLowerCase(), showbackground: false, showspikes: false, nticks: 5,
  });
  return {
    ...sizeOf(stageNode), margin: { l: 0, r: 0, t: 0, b: 0 }, showlegend: false, paper_bgcolor: "rgba(0,0,0,0)", hovermode: false,
    uirevision: "stage",
    scene: { aspectmode: "data", xaxis: axis("X", 0), yaxis: axis("Y", 1), zaxis: axis("Z", 2), dragmode: "orbit" },
  };
}

// Traces by layer, in the order plotly holds them: moving solids, labels, then what stays.
let layerOf = [];

function stageTraces(index) {
  const solids = bodies(index);
  const traces = Object.entries(solids).map(([name, s]) => ({ ...solidTrace(name, s), layer: SOLID_LAYERS[name] }));
  traces.push({ ...labelTrace(index), layer: "labels" });
  traces.push(...surfaceTraces().map((t) => ({ ...t, layer: "surfaces" })));
  traces.push(...pathTraces().map((t) => ({ ...t, layer: "traces" })));
  setPose(index);
  layerOf = traces.map((t) => t.layer);
  for (const trace of traces) {
    trace.visible = layersShown[trace.layer] ?? false;
    delete trace.layer;
  }
  return traces;
}

let stageReady = false, stageBusy = false, stageShows = -1;

async function drawStage() {
  stageBusy = true;
  setPose(lastGood.index);
  const layout = stageLayout();
  layout.scene.camera = stageNode.layout?.scene?.camera ?? { eye: eyeOf("Oblique"), up: CAMERAS.Oblique.up };
  await Plotly.react(stageNode, stageTraces(lastGood.index), layout, { displayModeBar: false, responsive: false });
  if (!stageReady) stageNode.on("plotly_relayout", turnedByHand);
  stageReady = true;
  stageBusy = false;
  stageShows = lastGood.index;
  moveStage(clock.index);
}

const MOVING = 6;  // platform, chains, joints, balls, forces, labels

// At most one update is under way; the newest time wins.
async function moveStage(index) {
  showAlerts(index);
  if (!stageReady || stageBusy || lastGood.index === stageShows) return;
  stageBusy = true;
  while (stageShows !== lastGood.index && stageReady) {
    const wanted = lastGood.index;
    setPose(wanted);
    const parts = [...Object.values(bodies(wanted)), labelTrace(wanted)];
    await Plotly.restyle(stageNode, { x: parts.map((p) => p.x), y: parts.map((p) => p.y), z: parts.map((p) => p.z) },
      [...Array(MOVING).keys()]);
    stageShows = wanted;
    stageNode.dataset.sample = wanted;
  }
  stageBusy = false;
}

// What is wrong at this sample. One without a result keeps the last picture.
function showAlerts(index) {
  const told = payload.alerts.filter((alert) => column(alert.column)[index] === 1);
  const message = document.getElementById("stage-message");
  message.hidden = !told.length;
  if (told.length) message.textContent = `t = ${time[index].toFixed(timeDecimals)} s: ${told.map((a) => a.text).join("; ")}`;
  if (!told.some((alert) => alert.failed)) lastGood.index = index;
}

function setCamera(name) {
  view = name;
  const { up, away } = CAMERAS[name];
  for (const button of document.querySelectorAll("#cameras button")) {
    button.setAttribute("aria-pressed", String(button.textContent === name));
  }
  const change = { "scene.camera.eye": eyeOf(name), "scene.camera.up": up, "scene.camera.center": { x: 0, y: 0, z: 0 } };
  for (const axis of ["x", "y", "z"]) change[`scene.${axis}axis.visible`] = axis !== away;
  Plotly.relayout(stageNode, change);
}

// A view turned by hand is no preset any more.
function turnedByHand(event) {
  if (!event["scene.camera"]) return;
  view = null;
  for (const button of document.querySelectorAll("#cameras button")) button.setAttribute("aria-pressed", "false");
  Plotly.relayout(stageNode, { "scene.xaxis.visible": true, "scene.yaxis.visible": true, "scene.zaxis.visible": true });
}

function setLayer(layer, on) {
  layersShown[layer] = on;
  const numbers = layerOf.flatMap((l, n) => (l === layer ? [n] : []));
  if (numbers.length) Plotly.restyle(stageNode, { visible: on }, numbers);
}

function stageNote() {
  const notes = [];
  const { samples: kept, total } = payload.columns;
  if (kept < total) notes.push(`The page shows ${kept} of ${total} samples, the largest and smallest values among them.`);
  if (drawn.largestForce) {
    const perCentimetre = 0.01 / drawn.metresPerNewton;
    notes.push(`Arrows: 10 mm stands for ${perCentimetre.toPrecision(2)} N; the longest is ${drawn.largestForce.toPrecision(4)} N.`);
  }
  return notes.join(" ");
}
