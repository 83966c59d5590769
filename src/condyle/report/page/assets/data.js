// The page's numbers: columns of samples by number, in SI.

const payload = JSON.parse(document.getElementById("payload").textContent);

function bytes(base64) {
  const text = atob(base64);
  const out = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) out[i] = text.charCodeAt(i);
  return out.buffer;
}

const samples = payload.columns.samples;
const time = new Float64Array(bytes(payload.columns.time));
const values = new Float32Array(bytes(payload.columns.values));

const column = (number) => values.subarray(number * samples, (number + 1) * samples);

// Of a run with more samples than the page has: the smallest and largest value of each curve in
// spans of time, in the order in which they were met.
const envelope = payload.columns.envelope && (() => {
  const { columns, edges, low, high, lowAt, highAt } = payload.columns.envelope;
  return {
    row: new Map(columns.map((number, row) => [number, row])), edges: new Float64Array(bytes(edges)),
    low: new Float32Array(bytes(low)), high: new Float32Array(bytes(high)),
    lowAt: new Uint16Array(bytes(lowAt)), highAt: new Uint16Array(bytes(highAt)),
  };
})();

// Points of a curve over time that show every peak.
function curve(number, scale) {
  const row = envelope?.row.get(number);
  if (row === undefined) return { x: time, y: scaled(number, scale) };
  const spans = envelope.edges.length - 1;
  const x = new Float64Array(2 * spans), y = new Float64Array(2 * spans);
  for (let i = 0; i < spans; i++) {
    const n = row * spans + i, start = envelope.edges[i], width = envelope.edges[i + 1] - start;
    const first = envelope.lowAt[n] <= envelope.highAt[n];
    const [a, b] = first ? ["low", "high"] : ["high", "low"];
    x[2 * i] = start + width * envelope[`${a}At`][n] / 65535;
    x[2 * i + 1] = start + width * envelope[`${b}At`][n] / 65535;
    y[2 * i] = envelope[a][n] * scale;
    y[2 * i + 1] = envelope[b][n] * scale;
  }
  return { x, y };
}

// Samples without a result, and the nearest sample with one: before, else after.
const failedColumns = payload.alerts.filter((alert) => alert.failed).map((alert) => column(alert.column));
const isFailed = (index) => failedColumns.some((failed) => failed[index] === 1);
const goodSample = (() => {
  const good = new Int32Array(samples);
  let last = -1;
  for (let i = 0; i < samples; i++) good[i] = isFailed(i) ? last : (last = i);
  for (let i = samples - 1, next = 0; i >= 0; i--) {
    if (good[i] >= 0) next = good[i]; else good[i] = next;
  }
  return good;
})();

// Why there is no result at a time.
function failureAt(t) {
  const found = payload.failures.find(([start, end]) => start <= t && t <= end);
  return found ? found[2] : "";
}

function scaled(number, scale) {
  return scale === 1 ? column(number) : Float64Array.from(column(number), (v) => v * scale);
}

// Sample nearest to time t; times rise but need not be even.
function sampleAt(t) {
  let low = 0, high = samples - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (time[middle] <= t) low = middle; else high = middle;
  }
  return t - time[low] <= time[high] - t ? low : high;
}

function shown(value, decimals) {
  if (!Number.isFinite(value)) return "\u2013";
  if (decimals > 6) return value === 0 ? "0" : value.toExponential(2);
  const text = value.toFixed(decimals);
  return Number(text) === 0 ? text.replace("-", "") : text;
}

const timeDecimals = (() => {
  const step = (time[samples - 1] - time[0]) / Math.max(samples - 1, 1);
  return step > 0 ? Math.min(Math.max(Math.ceil(-Math.log10(step) - 1e-9), 0), 6) : 3;
})();

// J_A and J_W as they are printed.
function mathematics(text) {
  return text.split(/\bJ_([AW])\b/).map((part, n) => (n % 2 ? element("i", {}, "J", element("sub", {}, part)) : part));
}

function element(name, attributes = {}, ...children) {
  const node = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key === "class") node.className = value;
    else node.setAttribute(key, value);
  }
  node.append(...children);
  return node;
}
