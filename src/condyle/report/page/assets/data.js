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

function element(name, attributes = {}, ...children) {
  const node = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key === "class") node.className = value;
    else node.setAttribute(key, value);
  }
  node.append(...children);
  return node;
}
