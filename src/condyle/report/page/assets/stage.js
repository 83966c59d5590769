// The mechanism in 3D, drawn with plotly and moved with the clock.

const stageNode = document.getElementById("stage");
const drawn = payload.machine;
const CAMERAS = drawn.views;
const FILL = 0.86;  // of the canvas
const DISTANCE = 3;
// Plotly takes the light's place through the projection, which styles it the other way.
const LIGHT = { x: -2000, y: 3000, z: -6000 };

// Scene units: the middle of the box is the origin, its longest side is 1.
const sides = drawn.range.map(([low, high]) => high - low);
const longest = Math.max(...sides);
const middle = drawn.range.map(([low, high]) => (low + high) / 2);
const xyz = (v) => ({ x: v[0], y: v[1], z: v[2] });

// Camera and scale with which a view shows everything, as large as it fits; without perspective.
function fitted(name) {
  const { from, up } = CAMERAS[name];
  const aspect = stageNode.clientWidth / Math.max(stageNode.clientHeight, 1);
  const away = unit(from), right = unit(cross(up, from)), above = cross(away, right);
  const [[x, wide], [y, high]] = [right, above].map((axis) => {
    const at = drawn.extent.map((p) => dot(minus(p, middle), axis) / longest);
    const low = Math.min(...at), top = Math.max(...at);
    return [(low + top) / 2, (top - low) / 2];
  });
  const scale = FILL * Math.min(aspect / wide, 1 / high);
  const centre = plus(right.map((v) => scale * x * v), above, scale * y);
  return {
    camera: { eye: xyz(plus(centre, away, DISTANCE)), center: xyz(centre), up: xyz(up), projection: { type: "orthographic" } },
    aspectratio: xyz(sides.map((side) => scale * side / longest)),
  };
}

let view = drawn.view;
const layersShown = Object.fromEntries([...document.querySelectorAll("[data-layer]")].map((button) => [button.dataset.layer, true]));
const GROUPS = Object.keys(drawn.layers), STILL = ["surfaces", "axes"];
const MOVED = GROUPS.filter((group) => !STILL.includes(group));
const solidsOf = Object.fromEntries(GROUPS.map((group) => [group, drawn.solids.filter((s) => s.group === group)]));

// Meshes of groups at a sample; grey and without forces where it stands for one without a result.
function meshes(groups, index, grey) {
  return groups.map((group) => {
    const mesh = new Mesh();
    for (const solid of solidsOf[group]) {
      const tint = grey && group !== "joints" ? role("neutral") : tintOf(solid, index);
      mesh.add(placed(solid, index), solid.faces, tint);
    }
    if (group === "forces") for (const force of drawn.forces) addForce(mesh, force, index, grey);
    return mesh;
  });
}

function addForce(mesh, { at, columns, metresPerNewton, into, gap, colour: name }, index, grey) {
  const vector = columns.map((c) => grey ? 0 : column(c)[index] * metresPerNewton);
  // At the ball's skin, or a small force would hide in it.
  const near = plus(position(at, index), unit(vector), into ? -gap : gap);
  mesh.arrow(into ? minus(near, vector) : near, vector, role(name));
}

function tintOf(solid, index) {
  if (solid.colour === "activation") return activationColour(solid, index);
  return typeof solid.colour === "number" ? colour(solid.colour) : role(solid.colour);
}

// From rest to the top of the panel's scale, by the colours of the theme; the last one beyond 1.
function activationColour({ column: number = null, scale }, index) {
  const whole = number === null ? 0 : Math.abs(column(number)[index] * scale) || 0;
  if (whole > 1 + 1e-6) return css("--activation-3");
  const value = 2 * Math.min(whole / drawn.activationTop, 1), k = Math.min(Math.floor(value), 1);
  const [low, high] = [k, k + 1].map((n) => css(`--activation-${n}`));
  const channel = (text, n) => parseInt(text.slice(n, n + 2), 16);
  return `rgb(${[1, 3, 5].map((n) => Math.round(channel(low, n) + (value - k) * (channel(high, n) - channel(low, n))))})`;
}

function solidTrace(group, mesh) {
  return {
    type: "mesh3d", name: group, layer: drawn.layers[group], x: mesh.x, y: mesh.y, z: mesh.z, i: mesh.i, j: mesh.j, k: mesh.k,
    facecolor: mesh.colours, hoverinfo: "skip", flatshading: group === "platform", opacity: solidsOf[group][0]?.opacity ?? 1,
    lighting: { ambient: 0.62, diffuse: 0.75, specular: 0.12, roughness: 0.7, fresnel: 0.05 },
    lightposition: LIGHT,
  };
}

// Lines through points of {S}, broken at null.
const apart = (lines) => lines.flatMap((line) => [...line, null]);

function lineTrace(layer, name, points, width, tint) {
  const [x, y, z] = [0, 1, 2].map((n) => points.map((p) => (p ? 1e3 * p[n] : null)));
  return { type: "scatter3d", mode: "lines", layer, name, x, y, z, hoverinfo: "skip", line: { width, color: css(tint) } };
}

function pathTraces() {
  const step = Math.max(Math.floor(samples / 1500), 1);
  return drawn.traces.map((trace) => {
    const path = [];
    for (let i = 0; i < samples; i += step) { setPose(i); path.push(position(trace.at, i)); }
    return lineTrace("traces", `path of ${trace.name}`, path, 3, "--cursor");
  });
}

// Names at one place of the picture stand beside each other, where the first is; each name away
// from the middle of the picture, and those of contacts below.
function labelTexts(named, places) {
  const groups = named.map((item) => [item.name]);
  let way = places.map(() => "top right");
  if (view) {
    const { from, up } = CAMERAS[view], right = unit(cross(up, from)), above = cross(unit(from), right);
    const seen = places.map((p) => [dot(p, right) / longest, dot(p, above) / longest]);
    seen.forEach(([x, y], n) => {
      const first = seen.findIndex(([a, b]) => Math.abs(a - x) < LABEL_WIDE && Math.abs(b - y) < LABEL_HIGH);
      if (first === n) return;
      groups[first].push(...groups[n]);
      groups[n] = [];
    });
    const known = seen.map(([x]) => x).filter(Number.isFinite), middle = (Math.min(...known) + Math.max(...known)) / 2;
    way = seen.map(([x]) => `top ${x < middle - LABEL_WIDE / 2 ? "left" : x > middle + LABEL_WIDE / 2 ? "right" : "center"}`);
  }
  return {
    text: groups.map((names) => plain(bothSides(names).join(", "))),
    textposition: way.map((one, n) => (n < drawn.landmarks.length ? one : "bottom center")),
  };
}

// Of a left and a right one what they have in common: in a row both would leave the picture.
function bothSides(names) {
  const common = (name) => name.replace(/(^|_)(left|right)(_|$)/, (_, before, side, after) => before && after);
  const count = (one) => names.filter((name) => common(name) === one).length;
  return [...new Set(names.map((name) => common(name) && count(common(name)) > 1 ? common(name) : name))];
}

const LABEL_WIDE = 0.12, LABEL_HIGH = 0.03;  // of the longest side, about a name's size

function labelTrace(index) {
  const named = [...drawn.landmarks, ...drawn.balls];
  const places = named.map((item) => position(item.at, index));
  return {
    ...pointTrace("labels", "markers+text", places), name: "landmarks", ...labelTexts(named, places),
    textfont: { size: 11, color: css("--ink") },
    marker: { size: named.map((_, n) => n < drawn.landmarks.length ? 4 : 0.1), color: css("--ink") },
  };
}

// Signs or texts at points of {S}; nothing where one is not known.
function pointTrace(layer, mode, points) {
  const [x, y, z] = [0, 1, 2].map((n) => points.map((p) => (Number.isFinite(p[n]) ? 1e3 * p[n] : null)));
  return { type: "scatter3d", mode, layer, name: layer, x, y, z, hoverinfo: "skip" };
}

// Measured markers: a sign and a colour for each body, nothing where one was not seen.
function markerTrace(index) {
  const styles = drawn.markers.map((marker) => drawn.markerStyles[marker.body]);
  return {
    ...pointTrace("markers", "markers", drawn.markers.map((marker) => marker.columns.map((c) => column(c)[index]))),
    hoverinfo: "text", text: drawn.markers.map((marker) => plain(marker.name)),
    marker: { size: 5, symbol: styles.map((one) => one.symbol), color: styles.map((one) => colour(one.colour)), line: { width: 0 } },
  };
}

// Plotly reads a little HTML in labels, and styles texts up in plain objects, where "constructor" is
// found before it was put there; a name is only text.
const plain = (text) => {
  const written = text.replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
  return written in {} ? `${written} ` : written;
};

function stageLayout() {
  const axis = (n) => ({ range: drawn.range[n].map((v) => 1e3 * v), visible: false, showspikes: false });
  return {
    ...sizeOf(stageNode), margin: { l: 0, r: 0, t: 0, b: 0 }, showlegend: false, paper_bgcolor: "rgba(0,0,0,0)", hovermode: false,
    uirevision: "stage",
    scene: { aspectmode: "manual", xaxis: axis(0), yaxis: axis(1), zaxis: axis(2), dragmode: "orbit" },
  };
}

// Traces in the order plotly holds them: moving solids, labels, markers, then what stays.
let layerOf = [];

function stageTraces(index, grey) {
  const solids = (groups) => meshes(groups, index, grey).map((mesh, n) => solidTrace(groups[n], mesh));
  const traces = [...solids(MOVED), labelTrace(index)];
  if (drawn.markers.length) traces.push(markerTrace(index));
  traces.push(...solids(STILL), lineTrace("surfaces", "bounds", apart(drawn.borders), 4, "--ink"), lineTrace("surfaces", "hatch", apart(drawn.hatch), 2, "--soft"));
  traces.push(...pathTraces(), { ...pointTrace("axes", "text", drawn.axisNames), text: ["X", "Y", "Z"], textfont: { size: 12, color: css("--soft") } });
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

const CHAINS = MOVED.indexOf("chains"), LABELS = MOVED.length;
const coloured = drawn.solids.some((solid) => solid.colour === "activation");

// Names after the picture has turned: some may overlap now.
function relabel() {
  if (!stageReady) return;
  const wanted = wantedAt(clock.index);
  setPose(wanted.drawn);
  const { text, textposition } = labelTrace(wanted.drawn), now = stageNode.data[LABELS];
  if (String([text, textposition]) === String([now.text, now.textposition])) return;
  Plotly.restyle(stageNode, { text: [text], textposition: [textposition] }, [LABELS]);
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
    const solids = meshes(MOVED, wanted.drawn, wanted.grey);
    const parts = [...solids, labelTrace(wanted.drawn)];
    if (drawn.markers.length) parts.push(markerTrace(wanted.drawn));
    if (stageShows.endsWith("true") !== wanted.grey) {
      await Plotly.restyle(stageNode, { facecolor: solids.map((s) => s.colours) }, [...solids.keys()]);
    }
    const moved = { x: parts.map((p) => p.x), y: parts.map((p) => p.y), z: parts.map((p) => p.z) };
    if (coloured) moved.facecolor = parts.map((p, n) => (n === CHAINS ? p.colours : undefined));
    await Plotly.restyle(stageNode, moved, [...parts.keys()]);
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
  if (stageReady) Plotly.relayout(stageNode, change(name)).then(relabel);
}

function change(name) {
  const { camera, aspectratio } = fitted(name);
  return {
    "scene.camera.eye": camera.eye, "scene.camera.up": camera.up, "scene.camera.center": camera.center,
    "scene.aspectratio": aspectratio,
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
